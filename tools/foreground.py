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

"""
Run a command in the foreground of the terminal, in a process group of its own.

make dies of the Ctrl-C that it shares with its recipe, so `make run` could not end with 0. With
the terminal handed to the command, Ctrl-C reaches the command alone and its exit status counts.
"""

import os
import signal
import subprocess
import sys
from types import FrameType


def hand_terminal_to(group: int) -> None:
    """Make a process group the terminal's foreground, if there is a terminal and it is ours."""
    try:
        terminal = os.open('/dev/tty', os.O_RDWR)
    except OSError:
        return
    try:
        os.tcsetpgrp(terminal, group)
    except OSError:
        pass
    finally:
        os.close(terminal)


def owns_terminal() -> bool:
    """Whether this process group is the terminal's foreground."""
    try:
        terminal = os.open('/dev/tty', os.O_RDWR)
    except OSError:
        return False
    try:
        return os.tcgetpgrp(terminal) == os.getpgrp()
    finally:
        os.close(terminal)


def run(command: list[str]) -> int:
    """Run a command, pass on to it what this process is sent, and return its exit status."""
    foreground = owns_terminal()
    # A background group that touches the terminal would be stopped otherwise.
    signal.signal(signal.SIGTTOU, signal.SIG_IGN)

    def start() -> None:
        os.setpgid(0, 0)
        if foreground:
            hand_terminal_to(os.getpid())
        signal.signal(signal.SIGTTOU, signal.SIG_DFL)

    process = subprocess.Popen(command, preexec_fn=start)

    def forward(number: int, frame: FrameType | None) -> None:
        # Not process.send_signal: that might take the exit status away from waitpid below.
        os.kill(process.pid, number)

    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, forward)
    while True:
        _, status = os.waitpid(process.pid, os.WUNTRACED)
        if not os.WIFSTOPPED(status):
            break
        # Ctrl-Z: stop the whole job, make too, and go on when the shell continues it.
        if foreground:
            hand_terminal_to(os.getpgrp())
        os.killpg(0, signal.SIGSTOP)
        if foreground:
            hand_terminal_to(process.pid)
        os.killpg(process.pid, signal.SIGCONT)
    if foreground:
        hand_terminal_to(os.getpgrp())
    code = os.waitstatus_to_exitcode(status)
    return code if code >= 0 else 128 - code


if __name__ == '__main__':
    sys.exit(run(sys.argv[1:]))
