"""Make a clean bag of one that was cut off or damaged, and report what is missing."""

from pathlib import Path

from .refusal import attempt, Parser


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
        from ..bags.recover import recover
        print(recover(given.bag, output))
        print(output)
        return 0

    return attempt('recover', run)
