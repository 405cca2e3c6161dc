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

"""The command `exponents`."""

from .. import options
from ..refusal import Parser
from ..run import Command
from ...core.defaults import EXPONENT_IMPACTS


def _add_options(parser: Parser) -> None:
    options.add_model(parser)
    options.add_plane(parser, size=400)
    options.add(parser, 'impacts', options.whole(1), EXPONENT_IMPACTS,
                'impacts of every trajectory')


main = Command('exponents', 'Find how fast neighbouring trajectories of every initial condition '
               'diverge or converge: the largest exponent of the first impacts.',
               _add_options)
