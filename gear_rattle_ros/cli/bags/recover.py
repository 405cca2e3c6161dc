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

"""Make a clean bag of one that was cut off or damaged, and report what is missing."""

from pathlib import Path

from ..refusal import attempt, Parser


def main(arguments: list[str] | None = None) -> int:
    parser = Parser('recover', description=(
        'Copy everything that can still be read of a cut or damaged bag into a new one with an '
        'index, and report what is missing. The bag itself is never touched.'))
    parser.add_argument('bag', metavar='BAG', type=Path, help='bag directory or .mcap file')
    parser.add_argument('output', nargs='?', metavar='OUTPUT', type=Path,
                        help='bag directory to make; default: BAG_recovered beside it')
    given = parser.parse_args(arguments)
    bag = given.bag.resolve()
    output = given.output or bag.with_name(f'{bag.stem}_recovered')

    def run() -> int:
        from ...bags.recover import recover
        print(recover(given.bag, output))
        print(output)
        return 0

    return attempt('recover', run)
