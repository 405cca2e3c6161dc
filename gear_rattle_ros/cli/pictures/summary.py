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

"""One picture of a bag: section, velocities, alpha, exponents, the last motion, in words."""

from pathlib import Path

from ..refusal import attempt, Parser
from ..run import add_picture, looks_of, require_picture


def main(arguments: list[str] | None = None) -> int:
    parser = Parser('summary', description='Make one picture of a bag.')
    parser.add_argument('bag', type=Path, metavar='BAG', help='bag directory or .mcap file')
    add_picture(parser)
    parser.add_argument('--output', dest='picture', type=Path, metavar='FILE',
                        help='the same as --picture; by default BAG-summary.png beside the bag')
    given = parser.parse_args(arguments)
    bag = given.bag.resolve()
    output = given.picture or bag.with_name(f'{bag.name}-summary.png')

    def run() -> int:
        from ...bags import Bag, BagError
        from ...figures.digest import digest_of
        from ...figures.summary import draw
        recorded = Bag(given.bag)
        require_picture(output)
        try:
            digest = digest_of(recorded.events())
        except BagError:
            raise
        except ValueError as error:
            raise ValueError(f'{given.bag}: {error}') from error
        draw(digest, bag.name, **looks_of(given)).savefig(output)
        print(output)
        return 0

    return attempt('summary', run)
