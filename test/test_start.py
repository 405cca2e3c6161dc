"""Executables start, or explain in one line why not."""

from pathlib import Path
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


def test_a_signal_that_an_import_swallows_ends_the_program(tmp_path: Path) -> None:
    (tmp_path / 'deaf.py').write_text(
        'import os, signal\n'
        'try:\n    os.kill(os.getpid(), signal.SIGINT)\n    import this\nexcept BaseException:\n'
        '    pass\n'
        'def main():\n    print("goes on")\n')
    code = (f'import gear_rattle_ros; from gear_rattle_ros import start; '
            f'gear_rattle_ros.__path__.append({str(tmp_path)!r}); '
            f'start.EXECUTABLES["deaf"] = "deaf"; start.start("deaf")')
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, '', '')
