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

from .. import options
from ..options import add, number, whole
from ..refusal import Parser
from ..run import Command
from ...core.defaults import WINDOWS


def _add_options(parser: Parser) -> None:
    options.add_model(parser, windows=WINDOWS, words=', once or several times')
    add(parser, 'columns', whole(2), 131, 'values in each window, evenly spaced')
    add(parser, 'trajectories', whole(1), 256, 'trajectories at each alpha')
    add(parser, 'keep', whole(1), 512, 'impacts kept of each')
    add(parser, 'tolerance', number, 1e-7, 'accuracy of what chaos does [1]')
    add(parser, 'hold', whole(256), 20_000,
        'a chaotic attractor lasts where trajectories stay for this number of impacts')
    options.add_plane(parser)
    options.add_seed(parser)


main = Command('transitions', 'Locate every transition of the attractors in windows of a '
               'parameter: births, doublings, mergings, crises and ends, with the orbits that '
               'chaos collides with.', _add_options, has_picture=False)
