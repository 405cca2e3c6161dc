"""The commands for bags start quickly."""

import subprocess
import sys

import pytest

from gear_rattle_ros.places import program


@pytest.mark.parametrize('name', ['export', 'recover', 'summary', 'verify'])
def test_help_needs_nothing_heavy(name: str) -> None:
    """Neither numba nor matplotlib nor a reader of bags is loaded for it."""
    code = (f'import sys\nfrom gear_rattle_ros.cli.{name} import main\n'
            'try:\n    main(["--help"])\nfinally:\n'
            '    assert not {"numba", "numpy", "matplotlib", "mcap"} & set(sys.modules)')
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, '')
    assert done.stdout.startswith(f'usage: {program(name)} ')
