"""
Coverage-guided fuzzing of what reads bags: no other error than our own, no hang, one line.

Needs atheris from PyPI (Python 3.11 to 3.13). The arguments are those of libFuzzer; inputs that
add coverage go to a folder of their own, what fails is left in crash-*. Run:
python test/fuzz/fuzz_bag.py -runs=100000
"""

from pathlib import Path
import sys
import tempfile

import atheris

with atheris.instrument_imports(include=['gear_rattle_ros.bags', 'gear_rattle_ros.core.points',
                                         'mcap']):
    import readers

CORPUS = Path(__file__).parent / 'corpus'


def one(data: bytes) -> None:
    """Read one input."""
    readers.read(data)


def main() -> None:
    """Fuzz from the inputs in the corpus, without adding to it."""
    with tempfile.TemporaryDirectory() as found:
        atheris.Setup([*sys.argv, '-timeout=10', '-max_len=20000', found, str(CORPUS)], one)
        atheris.Fuzz()


if __name__ == '__main__':
    main()
