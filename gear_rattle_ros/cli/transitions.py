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

"""The command `transitions`."""

import argparse
from typing import Any

from . import options
from .options import add, number, whole
from .refusal import Parser
from .run import Command
from ..core.defaults import WINDOWS


class _Windows(argparse.Action):
    """The first window that is given replaces the default ones."""

    def __call__(self, parser: argparse.ArgumentParser, given: argparse.Namespace, values: Any,
                 option: str | None = None) -> None:
        before = getattr(given, self.dest)
        setattr(given, self.dest, (*(() if before is self.default else before), tuple(values)))


def _add_options(parser: Parser) -> None:
    options.add_model(parser, None)
    parser.add_argument('--alpha', action=_Windows, type=number, nargs=2, default=WINDOWS,
                        metavar=('A', 'B'), help='window of alpha [1], once or several times; '
                        '0.47 0.6 and 1 1.75 by default')
    add(parser, 'columns', whole(2), 131, 'amplitudes of each window')
    add(parser, 'trajectories', whole(1), 256, 'trajectories at each alpha')
    add(parser, 'keep', whole(1), 512, 'impacts kept of each')
    add(parser, 'tolerance', number, 1e-7, 'accuracy of what chaos does, in alpha [1]')
    add(parser, 'hold', whole(256), 20_000,
        'a chaotic attractor lasts where trajectories stay for this number of impacts')
    options.add_plane(parser)
    options.add_seed(parser)


main = Command('transitions', 'Locate every transition of the attractors in windows of alpha: '
               'births, doublings, mergings, crises and ends, with the orbits that chaos collides '
               'with.', _add_options,
               keywords=lambda given: {'windows': given.alpha}, has_picture=False)
