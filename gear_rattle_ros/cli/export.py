"""The command `export`: the events of a bag as tables that other programs read."""

from pathlib import Path

from .refusal import attempt, Parser

ENDINGS = ('.csv', '.parquet')


def main(arguments: list[str] | None = None) -> int:
    parser = Parser('export', description='Write the events of a bag as a table, with a column '
                    'for each field of the record.')
    parser.add_argument('bag', metavar='BAG', type=Path, help='bag directory or .mcap file')
    parser.add_argument('files', nargs='*', metavar='FILE', type=Path, help='what to write: names '
                        f'end in {" or ".join(ENDINGS)}; by default BAG.csv beside the bag')
    parser.add_argument('--topic', default='', help='of the events; default: the only .../impacts')
    given = parser.parse_args(arguments)
    bag = given.bag.resolve()

    def run() -> int:
        files = given.files or [bag.with_name(f'{bag.name}.csv')]
        for file in files:
            if file.suffix not in ENDINGS:
                raise ValueError(f'{file} does not end in one of {" ".join(ENDINGS)}')
        from ..bags.export import export
        from ..core.words import counted
        count = export(given.bag, files, given.topic)
        for file in files:
            print(f'{file}: {counted(count, "event")}')
        return 0

    return attempt('export', run)
