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

"""The command `draw`: the picture of an existing dataset."""

from collections.abc import Sequence
from pathlib import Path

from ..refusal import attempt, Parser
from ..run import add_picture, add_views, looks_of, require_picture


def main(arguments: Sequence[str] | None = None) -> int:
    parser = Parser('draw', description='Draw a dataset again, without computing it again.')
    parser.add_argument('store', type=Path, metavar='STORE.zarr',
                        help='a store that a tool has written')
    add_picture(parser)
    add_views(parser)
    given = parser.parse_args(arguments)

    def action() -> int:
        picture = given.picture or given.store.with_suffix('.png')
        require_picture(picture)
        from ...figures.draw import save
        from ...store.store import open_dataset
        for path in save(open_dataset(given.store), picture, **looks_of(given)):
            print(path)
        return 0

    return attempt('draw', action)
