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

"""The command `section`."""

from pathlib import Path

from .. import options
from ..options import add, number, whole
from ..refusal import Parser
from ..run import Command
from ...core.defaults import SEED


def _add_options(parser: Parser) -> None:
    options.add_model(parser, alpha=1.23)
    add(parser, 'trajectories', whole(1), 64, 'random initial conditions')
    add(parser, 'skip', whole(0), 1000, 'impacts passed over first')
    add(parser, 'keep', whole(1), 20_000, 'impacts counted after that')
    add(parser, 'bins', whole(1), (720, 540), 'bins along phase and velocity')
    add(parser, 'bin-window', number, (-2.0, 2.0), 'velocities counted [1]')
    options.add_initial(parser)
    add(parser, 'noise', number, 0.0, 'standard deviation of the kick that an impact adds to the '
        'velocity of one trajectory [1]')
    options.add_plane(parser)
    add(parser, 'seed', whole(0), SEED, 'seed of the random initial conditions, and of the noise')
    parser.add_argument('--compare', type=Path, metavar='STORE.zarr',
                        help='compare the density with that of another section')


main = Command('section', 'Count impacts on the section of phase and velocity.', _add_options)
