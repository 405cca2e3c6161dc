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

"""The process of a node ends, whatever DDS does meanwhile."""

import os
import queue
import signal
import subprocess
import sys
import time
import types

import pytest

from gear_rattle_ros.nodes.base import process
from gear_rattle_ros.nodes.base.node import set_back
from gear_rattle_ros.nodes.base.process import woken

# Sleeps in C and holds the GIL, as Fast DDS does where it hangs: no signal handler runs.
PROGRAM = """
import ctypes
import sys
from gear_rattle_ros.nodes.base import process
from gear_rattle_ros.nodes.lyapunov import Lyapunov


process.ENDED_WITHIN = 1.0


class Hanging(Lyapunov):
    is_finished = True

    def destroy_node(self):
        print('closed')
        ctypes.PyDLL(None).sleep(600)


sys.exit(process.run_node('lyapunov', Hanging, []))
"""


def test_a_node_that_hangs_in_its_end_is_ended() -> None:
    """Within seconds, silently, with status 1; what was printed before arrives."""
    begin = time.monotonic()
    done = subprocess.run([sys.executable, '-c', PROGRAM], capture_output=True, text=True,
                          timeout=120)
    assert time.monotonic() - begin < 60.0
    assert done.returncode == 1
    assert 'Thread' not in done.stderr and 'Traceback' not in done.stderr


def test_a_signal_wakes_an_executor_that_waits(monkeypatch: pytest.MonkeyPatch) -> None:
    """At once where a signal comes, and again and again where the system clock was set back."""
    waking: queue.SimpleQueue[None] = queue.SimpleQueue()
    executor = types.SimpleNamespace(wake=lambda: waking.put(None))
    before = signal.signal(signal.SIGUSR1, lambda number, frame: None)
    try:
        with woken(executor):
            with pytest.raises(queue.Empty):
                waking.get(timeout=1.5)
            os.kill(os.getpid(), signal.SIGUSR1)
            waking.get(timeout=10.0)
        assert signal.set_wakeup_fd(-1) == -1
        monkeypatch.setattr(process, 'set_back', lambda: 3600.0)
        with woken(executor):
            for _ in range(2):
                waking.get(timeout=10.0)
    finally:
        signal.signal(signal.SIGUSR1, before)


def test_a_clock_set_back_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    """One that is set forward, or corrected by less than a second, is nobody's trouble."""
    now = time.time
    for step, back in ((-3600.0, 3600.0), (3600.0, 0.0), (-0.5, 0.0)):
        monkeypatch.setattr(time, 'time', lambda step=step: now() + step)
        assert set_back() == pytest.approx(back, abs=0.5)
