# Copyright 2026 The gear_rattle_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

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
extensions = ['myst_nb', 'sphinx.ext.autodoc', 'sphinx.ext.napoleon', 'mathml']
html_math_renderer = 'mathml'
# What other pages include.
exclude_patterns = ['reference/**']
# Many classes have an attribute called window or impacts; a unit does not refer to it.
suppress_warnings = ['ref.python']
napoleon_use_ivar = True
myst_enable_extensions = ['dollarmath']
myst_heading_anchors = 3
# The notebook is kept without its results. The first run compiles kernels.
nb_execution_mode = 'force'
nb_execution_raise_on_error = True
nb_execution_timeout = 600
nb_merge_streams = True
html_theme = 'furo'
html_static_path = ['static']
html_css_files = ['tables.css']
html_show_copyright = False
html_title = project
html_copy_source = False
html_show_sourcelink = False
