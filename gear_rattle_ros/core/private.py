"""The folder that serves where this user has no home that can be written."""

import functools
import os
from pathlib import Path
import stat
import tempfile


@functools.cache
def private_folder() -> Path:
    """Return a folder for temporary files that belongs to this user alone, the same every time."""
    folder = Path(tempfile.gettempdir()) / f'gear_rattle_ros-{os.getuid()}'
    folder.mkdir(mode=0o700, exist_ok=True)
    about = folder.lstat()
    # Anybody may have made it: what is compiled would be theirs.
    if about.st_uid != os.getuid() or about.st_mode & 0o022 or not stat.S_ISDIR(about.st_mode):
        raise PermissionError(
            f'{folder} belongs to somebody else; remove it, or set TMPDIR to another folder')
    return folder
