"""Executables start, or explain in one line why not."""

import subprocess
import sys

import pytest

from gear_rattle_ros.start import EXECUTABLES


@pytest.mark.parametrize(('name', 'missing'), [
    ('explorer', 'bokeh'), ('simulator', 'rclpy'), ('basins', 'zarr'), ('viewer', 'rerun')])
def test_a_missing_package_is_named(name: str, missing: str) -> None:
    """One line and exit status 2, however deep the import is."""
    code = (f'import sys; sys.modules[{missing!r}] = None; sys.argv = [{name!r}]; '
            f'from gear_rattle_ros.start import start; start({name!r})')
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True)
    assert name in EXECUTABLES and done.returncode == 2
    assert done.stderr == (
        f'{name}: the Python package {missing} is not installed; see doc/install.md\n')
