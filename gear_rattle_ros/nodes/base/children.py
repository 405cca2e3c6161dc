"""How a node starts other programs: apart from its terminal, and bound to its life."""

import ctypes
import functools
import signal
import subprocess
from typing import Any

_PR_SET_PDEATHSIG = 1
# Found before any fork, after which a thread that is gone may hold the loader's lock.
_PRCTL = ctypes.CDLL(None).prctl


def apart(number: int = signal.SIGTERM) -> dict[str, Any]:
    """
    Return options of `subprocess` for a silent child.

    The terminal's Ctrl-C does not reach it. If this process is killed, the kernel sends the child
    a signal; 0 lets it live on.
    """
    return {'stdin': subprocess.DEVNULL, 'stdout': subprocess.DEVNULL,
            'stderr': subprocess.DEVNULL, 'start_new_session': True,
            'preexec_fn': functools.partial(_PRCTL, _PR_SET_PDEATHSIG, number)}
