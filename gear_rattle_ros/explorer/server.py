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

"""The explorer: a page on this machine for the plane of initial conditions."""

import argparse
from collections.abc import Callable
import dataclasses
import errno
import itertools
import os
from pathlib import Path
import sys
import threading
from typing import NoReturn
import webbrowser

from bokeh.application import Application
from bokeh.application.handlers.function import FunctionHandler
from bokeh.document import Document
from bokeh.server.server import Server

from .address import Shown
from .computing.catalogues import Catalogues
from .computing.computing import pictures
from .computing.skeleton import Asked, LAYERS, Skeleton
from .computing.trajectory import follow
from .page import FIRST_POINT, Page, Shared
from .simulator_link import SimulatorLink
from .view import EXPONENTS, View
from ..cli.compilation import reporting_compilation
from ..cli.options import add_model, model_of
from ..cli.refusal import Parser
from ..gear_pairs import parse
from ..store.store import Store, StoreError

NAME = 'explorer'
ADDRESS = '127.0.0.1'
PORT = 5006
# A closed page is forgotten after this time, its work ends at once; interval of looking [ms].
LINGER = 15_000
LOOK_EVERY = 2_000


def make_server(shared: Shared, view: View, port: int) -> Server:
    """Return a server that listens on this machine only."""
    def open_page(document: Document) -> None:
        session = document.session_context
        joined = threading.Event()

        def is_open() -> bool:
            # The page has no connection before it is loaded, nor after its tab is closed.
            connections = session.session.connection_count if session.session else 0
            if connections:
                joined.set()
            return bool(connections) or not joined.is_set()

        shown, refused = Shown(view, FIRST_POINT), ''
        try:
            shown = shown.given(session.request.arguments)
        except ValueError as error:
            refused = str(error)
        page = Page(document, shared, shown, is_open, refused)
        document.on_session_destroyed(lambda context: page.close())

    return Server(
        {'/': Application(FunctionHandler(open_page))}, address=ADDRESS, port=port,
        allow_websocket_origin=[f'{name}:{port}' for name in (ADDRESS, 'localhost')],
        unused_session_lifetime_milliseconds=LINGER,
        check_unused_sessions_milliseconds=LOOK_EVERY)


def warm_up_layers(catalogues: Catalogues, view: View) -> None:
    """Compile or load the kernels of the layers, up to the first kick, while the page opens."""
    next(each for each in Skeleton(catalogues).layers(
        Asked(view, FIRST_POINT, LAYERS), lambda: None) if len(each.words) == len(LAYERS))


def serve(given: argparse.Namespace, refuse: Callable[[str], NoReturn]) -> int:
    """Serve until Ctrl-C or SIGTERM; `refuse` ends the program with one line."""
    try:
        view = View(model_of(given))
    except ValueError as error:
        refuse(str(error))
    above = next(each for each in (given.folder.resolve(), *given.folder.resolve().parents)
                 if each.exists())
    if not above.is_dir() or not os.access(above, os.W_OK):
        refuse(f'--folder {given.folder} cannot be written')
    try:
        tool = given.parameters and Store(given.parameters).attrs.get('tool')
        if tool not in (None, 'parameter_plane'):
            refuse(f'--parameters {given.parameters} is of the tool {tool}, not of '
                   'parameter_plane')
    except StoreError as error:
        refuse(str(error))
    shared = Shared(Catalogues(), SimulatorLink(), given.folder, given.parameters, given.pair)
    try:
        server = make_server(shared, view, given.port)
    except OSError as error:
        if error.errno not in (errno.EADDRINUSE, errno.EACCES):
            raise
        why = 'is taken' if error.errno == errno.EADDRINUSE else 'is not allowed'
        refuse(f'port {given.port} of {ADDRESS} {why}; choose another with --port')
    # Compile the kernels before anybody opens the page.
    with reporting_compilation(NAME, sys.stderr):
        for _ in itertools.islice(pictures(
                Catalogues(), dataclasses.replace(view, kind=EXPONENTS), lambda: None), 1):
            pass
        state = view.state(*FIRST_POINT)
        follow(view.parameters, state.phase, state.displacement, state.velocity)
    server.start()
    threading.Thread(target=warm_up_layers, args=(shared.catalogues, view), daemon=True).start()
    address = f'http://{ADDRESS}:{server.port}/'
    print(f'{NAME}: {address} (Ctrl-C ends it)', flush=True)
    if not given.no_browser:
        threading.Thread(target=webbrowser.open, args=(address,), daemon=True).start()
    try:
        server.io_loop.start()
    except KeyboardInterrupt:
        pass
    finally:
        shared.link.close()
    return 0


def main(arguments: list[str] | None = None) -> int:
    """Run the explorer; the exit status is 0, or 2 after one line that names the fault."""
    parser = Parser(NAME, description='Look at the plane of initial conditions in a browser.')
    add_model(parser)
    parser.add_argument('--parameters', type=Path, metavar='STORE.zarr',
                        help='a store of parameter_plane, also one that is still computed: its '
                        'map is shown below, and a click there sets the parameters')
    parser.add_argument('--port', type=_port, default=PORT, metavar='N',
                        help=f'port of {ADDRESS}; {PORT} by default')
    parser.add_argument('--no-browser', action='store_true', help='open no browser')
    parser.add_argument('--folder', type=Path, default=Path('explorer'), metavar='DIR',
                        help='where views are saved; explorer/ here by default')
    try:
        given = parse(parser, sys.argv[1:] if arguments is None else arguments)
    except ValueError as error:
        parser.error(str(error))
    return serve(given, parser.error)


def _port(text: str) -> int:
    if not text.isdecimal() or not 1 <= int(text) <= 65535:
        raise argparse.ArgumentTypeError(f'{text!r} is not a port from 1 to 65535')
    return int(text)
