"""The explorer needs Bokeh, which a bare ROS installation lacks."""

import pytest

pytest.importorskip('bokeh')
