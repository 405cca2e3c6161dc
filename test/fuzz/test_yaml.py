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

"""Recipes and scenes of any text are read, or refused by one error that names the file."""

from pathlib import Path

from hypothesis import given, settings, strategies as st
import pytest

from gear_rattle_ros.figures.paper import load_recipes
from gear_rattle_ros.scenes import read_scene

ROOT = Path(__file__).parents[2] / 'config'
WHOLE = [path.read_bytes() for folder in ('figures', 'scenes')
         for path in sorted((ROOT / folder).glob('*.yaml'))]


def check(folder: Path, content: bytes) -> int:
    """Return how many of both readers refuse a file, having seen that they name it."""
    path = folder / 'x.yaml'
    path.write_bytes(content)
    refused = 0
    for reads in (lambda: load_recipes(folder), lambda: read_scene(path)):
        try:
            reads()
        except ValueError as error:
            assert str(path) in str(error) and '\n' not in str(error)
            refused += 1
    return refused


@settings(max_examples=120, deadline=None)
@given(data=st.data())
def test_cut_and_flipped(tmp_path_factory: pytest.TempPathFactory, data: st.DataObject) -> None:
    """Whatever is cut off, flipped or put in, nothing escapes but that error."""
    whole = bytearray(data.draw(st.sampled_from(WHOLE)))
    for place in data.draw(st.lists(st.integers(0, 8 * len(whole) - 1), max_size=8)):
        whole[place // 8] ^= 1 << place % 8
    cut = data.draw(st.integers(0, len(whole)))
    check(tmp_path_factory.getbasetemp(), bytes(whole[:cut]) + data.draw(st.binary(max_size=9)))


def test_each_file_is_whole_for_its_reader(tmp_path: Path) -> None:
    """What is shipped is refused by the other reader only."""
    assert [check(tmp_path, content) for content in WHOLE] == [1] * len(WHOLE)


@pytest.mark.parametrize('text', [
    '[' * 1200, 'a: 2001-99-99', '!!int x: 1', '!!float "": 1', '!!timestamp x', '\x00', '\xff',
    '!!python/object:os.system x', 'figure: 3\ncommand: "basins \'"'])
def test_text_that_yaml_trips_over(tmp_path: Path, text: str) -> None:
    """Both refuse it."""
    assert check(tmp_path, text.encode('latin-1')) == 2
