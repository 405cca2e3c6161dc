"""A short soak; `python test/system/soak.py` runs the long ones."""

from pathlib import Path
import subprocess
import sys

import pytest


@pytest.mark.long
def test_a_minute_of_the_suite_with_parameters_changing(domain: int, tmp_path: Path) -> None:
    """Nothing lost, diagnostics right, the bag whole; memory may still be filling its pools."""
    soak = subprocess.run(
        [sys.executable, str(Path(__file__).with_name('soak.py')), '--minutes', '1', '--rate',
         '10', '--change', '1', '--slope-limit', '50000', '--folder', str(tmp_path / 'soak')],
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=500)
    assert soak.returncode == 0, soak.stdout
    assert '0 gaps' in soak.stdout
