"""The documents say what the code does."""

from pathlib import Path
import re
import sys

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / 'tools'))

import parameter_table  # noqa: E402

from gear_rattle_ros.core.model import EVENT  # noqa: E402


def test_readme_has_the_table_of_parameters_of_the_nodes():
    """The tables are those that tools/parameter_table.py writes now."""
    text = (ROOT / 'README.md').read_text(encoding='utf-8')
    assert parameter_table.updated(text) == text


def test_readme_names_every_field_of_an_event():
    """The table of the record is complete."""
    text = (ROOT / 'README.md').read_text(encoding='utf-8')
    assert all(f'`{name}`' in text for name in EVENT.names)


def test_links_of_the_documents_lead_somewhere():
    """Every relative link and picture exists."""
    for document in [ROOT / 'README.md', *(ROOT / 'doc').glob('*.md')]:
        for target in re.findall(r'\]\((?!http)([^)#]+)', document.read_text(encoding='utf-8')):
            assert (document.parent / target).exists(), f'{document.name}: {target}'
