"""The command `draw`: the picture of an existing dataset."""

from collections.abc import Sequence
from pathlib import Path

from .refusal import attempt, Parser
from .run import add_picture, add_views, looks_of, require_picture


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
        from ..figures.draw import save
        from ..store.store import open_dataset
        for path in save(open_dataset(given.store), picture, **looks_of(given)):
            print(path)
        return 0

    return attempt('draw', action)
