"""The site: `make doc` builds it into build/doc, without a network; a warning is an error."""

from pathlib import Path
import sys
import xml.etree.ElementTree as ElementTree

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE.parent), str(HERE.parent / 'tools')]

import reference_pages  # noqa: E402

reference_pages.write(HERE / 'reference')

project = 'gear_rattle_ros'
author = 'The gear_rattle_ros authors'
release = ElementTree.parse(HERE.parent / 'package.xml').findtext('version')
extensions = ['myst_parser', 'sphinx.ext.autodoc', 'sphinx.ext.napoleon', 'mathml']
html_math_renderer = 'mathml'
myst_enable_extensions = ['dollarmath']
# Many classes have an attribute called window or impacts; a unit is no reference to it.
suppress_warnings = ['ref.python']
napoleon_use_ivar = True
myst_heading_anchors = 3
html_theme = 'furo'
html_title = project
html_copy_source = False
html_show_sourcelink = False
