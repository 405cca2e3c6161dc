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

"""The command `boundary`."""

from .. import options
from ..options import add, number, whole
from ..refusal import Parser
from ..run import Command
from ...core.defaults import BASINS_CAP


def _add_options(parser: Parser) -> None:
    options.add_model(parser, windows=())
    add(parser, 'columns', whole(2), 14, 'values of a window, evenly spaced')
    options.add_plane(parser, size=400)
    add(parser, 'distances', number, (1e-9, 1e-1), 'smallest and largest distance of the probes')
    add(parser, 'per-decade', whole(1), 2, 'distances to a factor of ten')
    add(parser, 'error', number, 0.03, 'relative error of the share of probes that are cut')
    add(parser, 'cap', whole(1), BASINS_CAP, 'impacts after which a label is given up')
    options.add_search(parser)


main = Command('boundary', 'Measure how uncertain and how fractal the boundary between basins is, '
               'also against a parameter.',
               _add_options)
