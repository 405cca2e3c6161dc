"""Where the files of config/ are, and how programs are started here."""

import contextlib
import os
from pathlib import Path
import shutil
import sys

PACKAGE = 'gear_rattle_ros'


def config_folder(name: str) -> Path:
    """Return a folder of config/: in the checkout, else where the package is installed."""
    prefixes = [*os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep), sys.prefix]
    places = [Path(__file__).parents[1] / 'config' / name,
              *(Path(p) / 'share' / PACKAGE / 'config' / name for p in prefixes if p)]
    return next((place for place in places if place.is_dir()), places[0])


def typed(name: str) -> list[str]:
    """Return the words that start a program from here: of pip's one command, else of ROS."""
    if Path(sys.argv[0]).parts[-3:-1] == ('lib', PACKAGE):
        # Of a workspace, whatever else there is beside its Python.
        return ['ros2', 'run', PACKAGE, name]
    beside, found = Path(sys.executable).with_name('gear_rattle'), shutil.which('gear_rattle')
    if beside.exists() and found != str(beside):
        with contextlib.suppress(ValueError):
            beside = beside.relative_to(Path.cwd())
        return [str(beside), name]
    return ['gear_rattle', name] if found else ['ros2', 'run', PACKAGE, name]


def program(name: str) -> str:
    """Return what a program is called in its usage: `typed`, without the path."""
    command, *words = typed(name)
    return ' '.join([Path(command).name, *words])
