"""The house rules that a program can check."""

from pathlib import Path

import importlinter.cli
import pytest

ROOT = Path(__file__).parents[1]


def test_imports_keep_to_the_layers(
        monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """Every contract of pyproject.toml is kept."""
    monkeypatch.chdir(ROOT)
    monkeypatch.syspath_prepend(str(ROOT))
    status = importlinter.cli.lint_imports(no_cache=True)
    assert status == importlinter.cli.EXIT_STATUS_SUCCESS, capsys.readouterr().out
