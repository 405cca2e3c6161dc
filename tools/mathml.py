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

"""A Sphinx extension: formulas as MathML, which browsers show without a script or a network."""

import re

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.application import Sphinx
from sphinx.writers.html5 import HTML5Translator

# The number that a formula has in the paper.
TAG = re.compile(r'\\tag\{(.*?)\}')
# TeX's spaces, which MathML lacks: some round functions, none round bars and slashes.
THIN = '<mspace width="0.17em"/>'
FUNCTION = r'<mi>(?:sin|cos|ln|arctan|det)</mi>'
SPACES = (
    (re.compile(f'(?<=</m[in]>)(?={FUNCTION})'), THIN),
    (re.compile(f'({FUNCTION})(?=<m[a-np-z])'), rf'\1{THIN}'),
    (re.compile('<mo[^>]*>(?=&#x0007C;|&#x0002F;)'),
     '<mo stretchy="false" lspace="0" rspace="0">'),
)


def formula(text: str, display: str) -> str:
    """Convert a formula, without its number."""
    written = convert(TAG.sub('', text), display=display)
    for pattern, replacement in SPACES:
        written = pattern.sub(replacement, written)
    return written


def inline(translator: HTML5Translator, node: nodes.math) -> None:
    """Write a formula in the text."""
    translator.body.append(formula(node.astext(), 'inline'))
    raise nodes.SkipNode


def block(translator: HTML5Translator, node: nodes.math_block) -> None:
    """Write a displayed formula, with its number on the right."""
    text = node.astext()
    number = TAG.search(text)
    beside = f'<span class="eqno">({number[1]})</span>' if number else ''
    translator.body.append(
        f'<div class="math" style="margin: 1em 0">{beside}{formula(text, "block")}</div>\n')
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the way formulas are written."""
    app.add_html_math_renderer('mathml', (inline, None), (block, None))
    return {'parallel_read_safe': True}
