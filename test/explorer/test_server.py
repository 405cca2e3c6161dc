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

"""The explorer as a real process: this machine only, one clear line, a quiet end."""

import asyncio
from collections.abc import Callable
from pathlib import Path
import re
import signal
import socket
import urllib.request

import pytest
from tornado.httpclient import HTTPClientError, HTTPRequest
from tornado.websocket import websocket_connect

from gear_rattle_ros.explorer import server


def free_port() -> int:
    """Return a port that nobody has."""
    with socket.socket() as probe:
        probe.bind(('127.0.0.1', 0))
        return int(probe.getsockname()[1])


def test_page_is_served_to_this_machine_only(
        start: Callable[..., object], tmp_path: Path,
        capsys: pytest.CaptureFixture[str]) -> None:
    """No other host is named, no other address listens, no foreign page may connect."""
    port = free_port()
    process = start('explorer', '--no-browser', '--port', str(port), '--folder', str(tmp_path))
    process.wait_for(f'http://127.0.0.1:{port}/', within=180.0)
    page = urllib.request.urlopen(f'http://127.0.0.1:{port}/', timeout=30.0).read().decode()
    assert 'Gear rattle explorer' in page
    scripts = re.findall(r'<(?:script|link)[^>]*(?:src|href)="([^"]*)"', page)
    assert scripts and not [each for each in scripts if '//' in each]
    with socket.socket() as other, pytest.raises(OSError):
        other.connect(('127.0.0.2', port))

    async def connect(origin: str) -> None:
        await websocket_connect(HTTPRequest(
            f'ws://127.0.0.1:{port}/ws', headers={'Origin': origin}), subprotocols=['bokeh', 'x'])

    with pytest.raises(HTTPClientError) as refusal:
        asyncio.run(connect('http://elsewhere.example'))
    assert refusal.value.code == 403

    with pytest.raises(SystemExit, match='^2$'):
        server.main(['--no-browser', '--port', str(port), '--folder', str(tmp_path)])
    assert capsys.readouterr() == (
        '', f'explorer: port {port} of 127.0.0.1 is taken; choose another with --port\n')
    assert process.stop(signal.SIGINT) == 0
    assert 'Traceback' not in process.text()


@pytest.mark.parametrize(('words', 'line'), [
    (['--alpha', '-1'], 'explorer: alpha = -1.0 is outside [0, 1000]'),
    (['--port', '0'], "explorer: argument --port: '0' is not a port from 1 to 65535"),
    (['--folder', __file__], f'explorer: --folder {__file__} cannot be written')])
def test_wrong_arguments_get_one_line(
        words: list[str], line: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Exit status 2, nothing else."""
    try:
        status = server.main(['--no-browser', *words])
    except SystemExit as end:
        status = end.code
    assert status == 2
    assert capsys.readouterr().err.strip() == line
