"""Where the files of config/ are."""

import os
from pathlib import Path
import sys

PACKAGE = 'gear_rattle_ros'


def config_folder(name: str) -> Path:
    """Return a folder of config/: in the checkout, else where the package is installed."""
    prefixes = [*os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep), sys.prefix]
    places = [Path(__file__).parents[1] / 'config' / name,
              *(Path(p) / 'share' / PACKAGE / 'config' / name for p in prefixes if p)]
    return next((place for place in places if place.is_dir()), places[0])
