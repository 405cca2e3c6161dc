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

"""The documents agree with the code: tables, links, versions, and what examples print."""

import contextlib
import io
from pathlib import Path
import re
import sys
import xml.etree.ElementTree as ElementTree

from catkin_pkg.changelog import Changelog, populate_changelog_from_rst
from catkin_pkg.package_version import get_forthcoming_label, rename_section
import pytest
import yaml

import gear_rattle_ros

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / 'tools'))

import parameter_table  # noqa: E402, I100

PAGES = [ROOT / 'README.md', ROOT / 'CONTRIBUTING.md', *sorted((ROOT / 'doc').glob('*.md'))]
# An example, and what it prints.
EXAMPLE = re.compile(
    r'```python\n((?:(?!```).)*?)```\n(?:\n|prints\n)*```text\n(.*?)```', re.DOTALL)


def examples() -> list[tuple[str, str, str]]:
    """Return the page, the program and the output of every example that shows one."""
    return [(page.name, program, shown) for page in PAGES
            for program, shown in EXAMPLE.findall(page.read_text(encoding='utf-8'))]


def test_page_has_the_parameters_of_the_nodes():
    """The tables are those that tools/parameter_table.py writes now."""
    text = (ROOT / 'doc' / 'ros.md').read_text(encoding='utf-8')
    assert parameter_table.updated(text) == text


def test_page_names_every_field_of_an_event():
    """The table of the record is complete."""
    text = (ROOT / 'doc' / 'ros.md').read_text(encoding='utf-8')
    assert all(f'`{name}`' in text for name in gear_rattle_ros.EVENT.names)


def test_page_names_everything_at_the_front_door():
    """The table of the library has each name."""
    text = (ROOT / 'doc' / 'library.md').read_text(encoding='utf-8')
    assert [name for name in gear_rattle_ros.PLACES if f'`{name}`' not in text] == []


def test_links_of_the_documents_lead_somewhere():
    """Every relative link and picture exists."""
    for document in PAGES:
        for target in re.findall(r'\]\((?!http)([^)#]+)', document.read_text(encoding='utf-8')):
            assert (document.parent / target).exists(), f'{document.name}: {target}'


def test_citation_has_the_version_of_the_package():
    """CITATION.cff and package.xml agree."""
    citation = yaml.safe_load((ROOT / 'CITATION.cff').read_text(encoding='utf-8'))
    assert citation['version'] == ElementTree.parse(ROOT / 'package.xml').findtext('version')


@pytest.mark.parametrize(('page', 'program', 'shown'), examples(), ids=lambda part: part[:12])
def test_examples_print_what_the_pages_show(tmp_path, monkeypatch, page, program, shown):
    """Examples of the README and of the library run as they stand."""
    (tmp_path / 'doc').symlink_to(ROOT / 'doc')
    monkeypatch.chdir(tmp_path)
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(compile(program, page, 'exec'), {})
    assert printed.getvalue() == shown


def test_catkin_reads_the_changes():
    """The next version has its section, which a release names; everything in it is a list."""
    text = (ROOT / 'CHANGELOG.rst').read_text(encoding='utf-8')
    label = get_forthcoming_label(text)
    released = rename_section(text, label, '0.1.0 (2026-12-31)')
    changelog = Changelog(gear_rattle_ros.__name__)
    populate_changelog_from_rst(changelog, released)
    lists = changelog.get_content_of_version('0.1.0')
    assert len(lists) == 1 and len(list(lists[0])) == 3
    assert str(lists[0]).count('* ') > 50
