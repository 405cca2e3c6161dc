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

"""
Coverage-guided fuzzing of what reads: no other error than our own, no hang, one line.

Needs atheris from PyPI (Python 3.11 to 3.13). A target is a reader by itself, and fast; `all` are
all of them by turns. Further arguments are those of libFuzzer; inputs that add coverage go to a
folder of their own, what fails is left in crash-*. Run:
python test/fuzz/fuzz_bag.py --target cloud -runs=100000
"""

import argparse
from pathlib import Path
import sys
import tempfile

import atheris

with atheris.instrument_imports(include=[
        'gear_rattle_ros.bags', 'gear_rattle_ros.core.stream.event_points',
        'gear_rattle_ros.plain_yaml', 'mcap', 'yaml']):
    import readers

CORPUS = Path(__file__).parent / 'corpus'
# The first byte of inputs of a target, and of those in the corpus from which it starts.
TARGETS = {'all': (b'', b''), 'bag': (b'M', b'M'), 'cloud': (b'C', b'C'),
           'metadata': (b'Y', b'Y'), 'salvage': (b'S', b'M')}


def main() -> None:
    """Fuzz from the inputs in the corpus, without adding to it."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n\n')[0])
    parser.add_argument('--target', choices=TARGETS, default='all')
    options, rest = parser.parse_known_args()
    letter, start = TARGETS[options.target]

    def one(data: bytes) -> None:
        readers.read(letter + data)

    with tempfile.TemporaryDirectory() as found:
        for path in sorted(CORPUS.iterdir()):
            data = path.read_bytes()
            if data.startswith(start):
                (Path(found) / path.name).write_bytes(data[len(letter):])
        atheris.Setup([sys.argv[0], *rest, '-timeout=10', '-max_len=20000', found], one)
        atheris.Fuzz()


if __name__ == '__main__':
    main()
