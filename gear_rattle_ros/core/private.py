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
            f'{folder} is not a folder of this user alone; remove it, or set TMPDIR to another')
    return folder
