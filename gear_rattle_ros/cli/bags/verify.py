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

"""Verify bags: rebuild every flight and reproduce each record, bit for bit."""

import functools
from pathlib import Path

from ..refusal import attempt, Parser


def main(arguments: list[str] | None = None) -> int:
    """Verify bags; the exit status is 1 where one is not verified, 2 where one is not readable."""
    parser = Parser('verify', description=(
        'Rebuild every flight of a recorded run from the bag alone, reproduce each event bit for '
        'bit, and recompute the exponents and transients that were recorded live.'))
    parser.add_argument('bags', nargs='+', metavar='BAG', type=Path,
                        help='bag directory or .mcap file')
    parser.add_argument('--topic', default='', help='of the events; default: the only .../impacts')
    given = parser.parse_args(arguments)

    def one(path: Path) -> int:
        from ...bags.verify import verify
        verdict = verify(path, given.topic)
        print(f'{path}: {verdict}', flush=True)
        return 0 if verdict.is_verified else 1

    return max(attempt('verify', functools.partial(one, path)) for path in given.bags)
