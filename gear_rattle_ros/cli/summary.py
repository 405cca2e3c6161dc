"""One picture of a bag: section, velocities, alpha, exponents, the last motion, in words."""

from pathlib import Path

from .refusal import attempt, Parser


def main(arguments: list[str] | None = None) -> int:
    """Draw the picture of a bag."""
    parser = Parser('summary', description='Make one picture of a bag.')
    parser.add_argument('bag', type=Path, metavar='BAG', help='bag directory or .mcap file')
    parser.add_argument('--output', type=Path, metavar='FILE.png',
                        help='the picture; by default summary.png beside the bag')
    given = parser.parse_args(arguments)
    bag = given.bag.resolve()
    output = given.output or bag.parent / 'summary.png'

    def run() -> int:
        from ..bags import Bag, BagError
        from ..figures.digest import digest_of
        from ..figures.summary import draw, save
        at = given.bag
        try:
            digest = digest_of(Bag(given.bag).events())
            at = output
            save(draw(digest, bag.name), output)
        except BagError:
            raise
        except ValueError as error:
            raise ValueError(f'{at}: {error}') from error
        print(output)
        return 0

    return attempt('summary', run)
