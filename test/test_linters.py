"""The linters of ament, where they are installed, as ROS packages run them."""

import importlib
from pathlib import Path
import shutil

import pytest

ROOT = Path(__file__).parents[1]
SOURCES = ['gear_rattle_ros', 'test', 'tools', 'benchmark', 'config', 'doc']
LINTERS = {
    'copyright': [*SOURCES, 'CONTRIBUTING.md', 'LICENSE'],
    'flake8': ['--config', 'setup.cfg', *SOURCES, 'setup.py'],
    'pep257': ['gear_rattle_ros', 'config'],
    'xmllint': ['package.xml', 'config'],
}


@pytest.mark.parametrize('name', LINTERS)
def test_linter_has_no_complaint(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its status is 0."""
    pytest.importorskip(f'ament_{name}')
    if name == 'xmllint' and shutil.which('xmllint') is None:
        pytest.skip('no xmllint here')
    monkeypatch.chdir(ROOT)
    assert importlib.import_module(f'ament_{name}.main').main(argv=LINTERS[name]) == 0
