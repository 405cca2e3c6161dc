"""The process of a node ends, whatever DDS does meanwhile."""

import subprocess
import sys
import time

# Sleeps in C and holds the GIL, as Fast DDS does where it hangs: no signal handler runs.
PROGRAM = """
import ctypes
import sys
from gear_rattle_ros.nodes.base.process import run_node
from gear_rattle_ros.nodes.lyapunov import Lyapunov


class Hanging(Lyapunov):
    is_finished = True

    def destroy_node(self):
        print('closed')
        ctypes.PyDLL(None).sleep(600)


sys.exit(run_node('lyapunov', Hanging, []))
"""


def test_a_node_that_hangs_in_its_end_is_ended() -> None:
    """Within seconds, silently, with status 1; what was printed before arrives."""
    begin = time.monotonic()
    done = subprocess.run([sys.executable, '-c', PROGRAM], capture_output=True, text=True,
                          timeout=120)
    assert time.monotonic() - begin < 60.0
    assert done.returncode == 1
    assert 'Thread' not in done.stderr and 'Traceback' not in done.stderr
