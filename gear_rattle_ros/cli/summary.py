"""One picture of a bag: section, velocities, alpha, exponents, the last motion, in words."""

from pathlib import Path

from .refusal import attempt, Parser
from .run import add_picture, looks_of, require_picture


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
        from ..bags import Bag, BagError
        from ..figures.digest import digest_of
        from ..figures.summary import draw
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
