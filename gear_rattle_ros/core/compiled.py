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

"""How kernels are compiled: one decorator, the same settings everywhere."""

from collections.abc import Callable
import functools
import hashlib
import os
from pathlib import Path
import re
import tempfile
from typing import Any, cast, Final, TypeVar

import numba

from .private import private_folder

# All kernels take about 70 MB [bytes].
ROOM: Final = 100 << 20
# Nothing in C calls a kernel: what is left out for that is a twelfth of the compilation.
OPTIONS: Final[dict[str, Any]] = {
    'nogil': True, 'error_model': 'numpy', 'no_cfunc_wrapper': True}
# An import from this package, in its only form: the dots and the module.
IMPORTED: Final = re.compile(r'^from (\.+)([\w.]+) import', re.MULTILINE)
Function = TypeVar('Function', bound=Callable[..., Any])


@functools.cache
def cache_directory() -> Path | None:
    """Return the folder of compiled kernels: of the user, else a temporary one, else none."""
    base = os.environ.get('NUMBA_CACHE_DIR') or os.environ.get('XDG_CACHE_HOME')
    for place in (lambda: Path(base) if base else Path.home() / '.cache', private_folder):
        try:
            folder = place() / 'gear_rattle_ros'
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=folder) as file:
                memory = os.fstatvfs(file.fileno())
            # What is there already needs no room.
            if memory.f_bavail * memory.f_frsize >= ROOM or any(folder.rglob('*.nbi')):
                return folder
        except (OSError, RuntimeError):
            # Not to be written, or no home.
            continue
    return None


@functools.cache
def sources(path: Path) -> frozenset[Path]:
    """Return the files that a file of this package imports, itself included."""
    found = {path}
    for dots, name in IMPORTED.findall(path.read_text()):
        place = path.parents[len(dots) - 1].joinpath(*name.split('.'))
        # Of a package it may be any module.
        for imported in place.glob('*.py') if place.is_dir() else [place.with_suffix('.py')]:
            found |= sources(imported)
    return frozenset(found)


@functools.cache
def _folder_for(path: Path) -> str:
    # numba notices a change of the file a kernel stands in, but not of the kernels that it calls
    # from other files: so the contents of all that it imports name the folder.
    folder = cache_directory()
    if folder is None:
        return ''
    digest = hashlib.sha256(numba.__version__.encode())
    for source in sorted(sources(path) | {Path(__file__)}):
        digest.update(source.read_bytes())
    return str(folder / digest.hexdigest()[:16])


def kernel(function: Function) -> Function:
    """Compile scalar numeric code with numba, cached on disk; it releases the GIL."""
    # Without fused multiply-add and reordering, the same input gives the same bits on every
    # machine that rounds as IEEE 754 says. Division by zero gives what numpy gives.
    # The folder is looked up when the function is decorated; other packages keep their own.
    config: Any = numba.config
    others = config.CACHE_DIR
    folder = _folder_for(Path(function.__code__.co_filename))
    config.CACHE_DIR = folder
    try:
        compiled = numba.njit(cache=folder != '', **OPTIONS)(function)
    finally:
        config.CACHE_DIR = others
    return cast(Function, compiled)
