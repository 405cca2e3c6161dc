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

"""The process of a node: its start, its signals, its children, its exit status."""

from collections.abc import Callable, Iterator
import contextlib
import ctypes
import errno
import faulthandler
import functools
import gc
import os
import select
import signal
import socket
import subprocess
import sys
import threading
from types import FrameType
from typing import Any, TypeVar

import rclpy
from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor
from rclpy.logging import get_logger_level, get_logging_severity_from_string, set_logger_level
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import try_shutdown

from . import arguments as given
from .dds_room import avoid_memory
from .errors import UserError
from .node import ReportingNode, set_back

# A node is taken down within this time [s].
ENDED_WITHIN = 4.0
# A signal is seen between two callbacks, or at the latest after this time [s].
STOP_SEEN_WITHIN = 0.1
# Found before any fork, after which a thread that is gone may hold the loader's lock.
_PRCTL = ctypes.CDLL(None).prctl
_PR_SET_PDEATHSIG = 1
Made = TypeVar('Made')


class Stop:
    """SIGINT and SIGTERM: they interrupt the start, and end the spinning between two callbacks."""

    def __init__(self) -> None:
        self.asked = False
        self.spinning = False
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._handle)

    def _handle(self, number: int, frame: FrameType | None) -> None:
        self.asked = True
        if not self.spinning:
            raise KeyboardInterrupt


def apart(number: int = signal.SIGTERM) -> dict[str, Any]:
    """Return options of `subprocess` for a silent child that Ctrl-C in the terminal misses."""
    # If this process is killed, the kernel sends the signal to the child; 0 lets it live on.
    return {'stdin': subprocess.DEVNULL, 'stdout': subprocess.DEVNULL,
            'stderr': subprocess.DEVNULL, 'start_new_session': True,
            'preexec_fn': functools.partial(_PRCTL, _PR_SET_PDEATHSIG, number)}


@contextlib.contextmanager
def ended_in_time() -> Iterator[None]:
    """End the process with status 1 where DDS hangs when it is taken down; files are closed."""
    # Fast DDS of the wheels may spin for ever there, holding the GIL, where others end at the same
    # moment: only a thread of C can end that.
    say()
    with open(os.devnull, 'w') as nowhere:
        faulthandler.dump_traceback_later(ENDED_WITHIN, exit=True, file=nowhere)
        try:
            yield
        finally:
            faulthandler.cancel_dump_traceback_later()


def say(*words: str) -> None:
    """Print a line, or only what is held back; who reads it may be gone, and changes nothing."""
    try:
        if words:
            print(*words)
        sys.stdout.flush()
    except OSError as error:
        if error.errno not in (errno.EPIPE, errno.EBADF):
            raise
        sys.stdout = open(os.devnull, 'w')


@contextlib.contextmanager
def woken(executor: Executor) -> Iterator[None]:
    """Wake an executor at every signal, and where the system clock was set back."""
    # Fast DDS of the wheels waits by the system clock, and Python handles signals between waits.
    reader, writer = socket.socketpair()
    writer.setblocking(False)

    def wake() -> None:
        is_asked = False
        while True:
            pause = STOP_SEEN_WITHIN if is_asked else 1.0
            is_signal, _, _ = select.select([reader], [], [], pause)
            if is_signal and not reader.recv(64):
                return
            # An executor that is woken before its time is over waits again.
            is_asked |= bool(is_signal)
            if is_asked or set_back():
                executor.wake()

    thread = threading.Thread(target=wake, name='waking', daemon=True)
    thread.start()
    before = signal.set_wakeup_fd(writer.fileno(), warn_on_full_buffer=False)
    try:
        yield
    finally:
        signal.set_wakeup_fd(before)
        writer.close()
        thread.join()
        reader.close()


def begin(ros: list[str]) -> None:
    """Begin ROS with its arguments; UserError or ValueError names one that it refuses."""
    given.refuse_large_files(ros)
    level, fatal = get_logger_level('rcl'), get_logging_severity_from_string('FATAL')
    # What rcl would log of a bad argument comes as the exception, too.
    set_logger_level('rcl', fatal)
    try:
        # rclpy's own handlers would invalidate the context under a callback that publishes.
        rclpy.init(args=ros, signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:
        raise UserError(given.refused_argument(ros, error)) from error
    finally:
        if get_logger_level('rcl') == fatal:
            set_logger_level('rcl', level)


def exit_status(name: str, arguments: list[str] | None, make: Callable[[], Made],
                run: Callable[[Made, Stop], int]) -> int:
    """Run a program in the ROS graph: 2 after one line where its user has to fix something."""
    stop = Stop()
    try:
        try:
            plain, ros = given.split_arguments(sys.argv[1:] if arguments is None else arguments)
            if plain and plain[0] in ('-h', '--help'):
                print(given.help_on(name))
                return 0
            given.refuse_plain(name, plain)
            lacking = avoid_memory()
            begin(ros)
            for line in filter(None, (lacking, *given.misspelt_sections(name, ros))):
                print(f'{name}: {line}', file=sys.stderr, flush=True)
            made = make()
        except ValueError as error:
            raise UserError(str(error)) from error
        stop.spinning = True
        try:
            return run(made, stop)
        finally:
            if isinstance(made, Node):
                with ended_in_time():
                    made.destroy_node()
    except UserError as error:
        print(f'{name}: {error}', file=sys.stderr)
        return 2
    except (KeyboardInterrupt, ExternalShutdownException):
        return 0
    finally:
        # From here on a second Ctrl-C must not cut what is being written.
        stop.spinning = True
        # A node that was not completed holds shared memory, which would outlive the process.
        gc.collect()
        with ended_in_time():
            try_shutdown()


def run_node(name: str, make: Callable[[], ReportingNode], arguments: list[str] | None = None, *,
             room: Callable[[], str] = str) -> int:
    """Spin a node until it is finished or a signal comes, and return the exit status."""
    def make_with_room() -> ReportingNode:
        # DDS is asked for room before the first node of a process is made, or never.
        lacking = room()
        node = make()
        if lacking:
            node.get_logger().warning(lacking)
        return node

    return exit_status(name, arguments, make_with_room, _spin)


def _spin(node: ReportingNode, stop: Stop) -> int:
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    try:
        with woken(executor):
            while not (stop.asked or node.is_finished):
                executor.spin_once(timeout_sec=STOP_SEEN_WITHIN)
    finally:
        node.close()
    return node.exit_status
