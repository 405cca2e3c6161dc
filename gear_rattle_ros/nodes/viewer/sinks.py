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

"""Where the viewer's recordings go: a file, a window, a web page on this machine only."""

import contextlib
import importlib.util
import os
from pathlib import Path
import signal
import socket
import subprocess
import time
from typing import Final
from urllib.parse import quote

import rerun as rr

from .axes import blueprint
from ..base.errors import UserError
from ..base.process import apart

LOOPBACK: Final = '127.0.0.1'
# Memory of a window or the web server; beyond it the oldest data are dropped.
MEMORY_LIMIT: Final = '1GB'
# How long a child may take to start listening, and to end [s].
START_LIMIT: Final = 10.0
END_LIMIT: Final = 2.0
# A file is given its index at the end, unless it is larger or that takes longer [bytes], [s].
INDEXED_MOST: Final = 1_000_000_000
INDEXED_WITHIN: Final = 6.0


def chosen_mode(mode: str, save: str) -> str:
    """Return native, web or none; auto is native on a display, else web unless there is a file."""
    if mode == 'auto':
        if os.environ.get('DISPLAY') or os.environ.get('WAYLAND_DISPLAY'):
            return 'native'
        return 'none' if save else 'web'
    if mode == 'none' and not save:
        raise UserError("mode = 'none' without a file draws nothing: give save:=FILE.rrd")
    return mode


def file_recording(save: str, colour: str) -> rr.RecordingStream:
    path = Path(save)
    if path.suffix != '.rrd':
        raise UserError(f'save = {save!r} must end in .rrd')
    if path.exists():
        raise UserError(f'save = {save!r} exists: name another file, or remove it')
    try:
        path.touch()
    except OSError as error:
        raise UserError(f'save = {save!r} cannot be written: {error.strerror}') from error
    # A sink holds the index it writes in memory until the end, 2 kB for every piece drawn.
    return _recording(rr.FileSink(path, write_footer=False), colour)


def add_index(save: str) -> str:
    """Give a finished file its index, by which rerun finds its way; return why it has none."""
    path = Path(save)
    whole = path.with_name(f'.{path.name}.{os.getpid()}')
    try:
        if path.stat().st_size > INDEXED_MOST:
            return f'it is larger than {INDEXED_MOST >> 20} MB'
        subprocess.run(
            [_executable(), 'rrd', 'optimize', '--profile', 'live', str(path), '-o', str(whole)],
            check=True, timeout=INDEXED_WITHIN, **apart(signal.SIGKILL))
        whole.chmod(path.stat().st_mode)
        whole.replace(path)
    except (OSError, subprocess.SubprocessError, UserError) as error:
        with contextlib.suppress(OSError):
            whole.unlink()
        return str(error)
    return ''


class Window:
    """A rerun viewer that runs as a child, and the recording that goes to it."""

    def __init__(self, mode: str, web_port: int, colour: str) -> None:
        self._stays = mode == 'native'
        with socket.socket() as probe:
            probe.bind((LOOPBACK, 0))
            port = int(probe.getsockname()[1])
        url = f'rerun+http://{LOOPBACK}:{port}/proxy'
        command = [_executable(), '--bind', LOOPBACK, '--port', str(port)]
        if self._stays:
            command += ['--memory-limit', MEMORY_LIMIT, '--hide-welcome-screen',
                        '--expect-data-soon']
            self.page, self.place = '', 'a window'
        else:
            if _listens(web_port):
                raise UserError(f'web_port = {web_port} is in use: choose another')
            command += ['--serve-web', '--web-viewer-port', str(web_port),
                        '--server-memory-limit', MEMORY_LIMIT]
            self.page = self.place = f'http://{LOOPBACK}:{web_port}/?url={quote(url, safe="")}'
        self._child = subprocess.Popen(command, **apart(0 if self._stays else signal.SIGTERM))
        self._wait_for([port] if self._stays else [port, web_port])
        self.recording = _recording(rr.GrpcSink(url), colour)

    @property
    def is_open(self) -> bool:
        return self._child.poll() is None

    def close(self) -> None:
        """End the web server; a window stays until its user closes it."""
        if self._stays:
            return
        self._child.terminate()
        try:
            self._child.wait(END_LIMIT)
        except subprocess.TimeoutExpired:
            self._child.kill()
            self._child.wait()

    def _wait_for(self, ports: list[int]) -> None:
        limit = time.monotonic() + START_LIMIT
        while not all(_listens(port) for port in ports):
            if not self.is_open or time.monotonic() > limit:
                self._child.kill()
                status = self._child.wait()
                raise UserError(
                    f'the rerun viewer does not start (status {status}); try mode:=web, or '
                    'mode:=none save:=FILE.rrd')
            time.sleep(0.05)


def _recording(sink: rr.FileSink | rr.GrpcSink, colour: str) -> rr.RecordingStream:
    recording = rr.RecordingStream('gear_rattle_ros')
    recording.set_sinks(sink, default_blueprint=blueprint(colour))
    return recording


def _executable() -> str:
    # The wheel's own program: what PATH has may be of another version.
    found = importlib.util.find_spec('rerun_cli')
    if found is None or found.origin is None:
        raise UserError('rerun-sdk has no viewer here; try mode:=none save:=FILE.rrd')
    return str(Path(found.origin).parent / 'rerun')


def _listens(port: int) -> bool:
    with socket.socket() as probe:
        probe.settimeout(0.2)
        return probe.connect_ex((LOOPBACK, port)) == 0
