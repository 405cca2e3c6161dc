"""How kernels are compiled: one decorator, the same settings everywhere."""

from collections.abc import Callable
import functools
import hashlib
import os
from pathlib import Path
import tempfile
from typing import Any, cast, TypeVar

import numba

Function = TypeVar('Function', bound=Callable[..., Any])


@functools.cache
def cache_directory() -> Path:
    """Return the folder of compiled kernels, a temporary one where none can be written."""
    # numba notices a change of the file a kernel stands in, but not of the kernels that it calls
    # from other files: so the contents of the whole of ``core`` name the folder.
    digest = hashlib.sha256(numba.__version__.encode())
    for source in sorted(Path(__file__).parent.rglob('*.py')):
        digest.update(source.read_bytes())
    base = os.environ.get('NUMBA_CACHE_DIR') or os.environ.get('XDG_CACHE_HOME')
    folder = (Path(base) if base else Path.home() / '.cache') / 'gear_rattle_ros'
    folder = folder / digest.hexdigest()[:16]
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except OSError:
        return Path(tempfile.mkdtemp(prefix='gear_rattle_ros-'))


def kernel(function: Function) -> Function:
    """Compile scalar numeric code with numba, cached on disk; it releases the GIL."""
    # Without fused multiply-add and reordering, the same input gives the same bits on every
    # machine that rounds as IEEE 754 says. Division by zero gives what numpy gives.
    # The folder is looked up when the function is decorated; other packages keep their own.
    config: Any = numba.config
    others = config.CACHE_DIR
    config.CACHE_DIR = str(cache_directory())
    try:
        compiled = numba.njit(cache=True, nogil=True, error_model='numpy')(function)
    finally:
        config.CACHE_DIR = others
    return cast(Function, compiled)
