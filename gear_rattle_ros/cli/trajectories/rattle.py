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

"""The command `rattle`."""

import argparse
import os
from pathlib import Path
from typing import Any, TYPE_CHECKING

from .. import options
from ..options import add, number, whole
from ..refusal import Parser
from ..run import Command

if TYPE_CHECKING:
    from ...store.store import Store


def _add_options(parser: Parser) -> None:
    options.add_model(parser)
    parser.add_argument('--run-up', type=number, nargs=2, metavar=('A', 'B'),
                        help='speeds [1/min], or frequencies [Hz] where one is given')
    add(parser, 'points', whole(2), 61, 'speeds of the run-up')
    add(parser, 'above', number, 0.0, 'approach speed from which impacts count for rates and '
        'speeds [m/s]')
    add(parser, 'orders', whole(1), 20, 'highest order of the spectrum')
    add(parser, 'periods', whole(1), 200,
        'drive periods over which a motion that is not periodic is measured')
    options.add_plane(parser)
    options.add_search(parser, initial_conditions=300, hold=20_000)
    parser.add_argument('--wav', type=Path, metavar='FILE.wav',
                        help='write the sound of the impacts; in a run-up one speed after another')
    add(parser, 'seconds', number, 10.0, 'length of that sound [s]')


def _check(given: argparse.Namespace) -> dict[str, Any]:
    """Refuse a sound that cannot be written before a long computation, not after it."""
    if given.wav and (given.wav.suffix != '.wav' or given.wav.is_dir()
                      or not os.access(given.wav.resolve().parent, os.W_OK)):
        raise ValueError(f'--wav {given.wav} cannot be written, or does not end in .wav')
    return {}


def _finish(given: argparse.Namespace, store: 'Store') -> list[Path]:
    from ...figures.rattle import save_wav
    return [save_wav(store, given.wav, given.seconds)] if given.wav else []


main = Command('rattle', 'Find whether a gear pair rattles, how often and how hard, at one speed '
               'or in a run-up.', _add_options, _check, finish=_finish)
