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

"""Damaged input is refused in one line, or read; the corpus, cut and with bits flipped."""

from collections.abc import Iterator
from pathlib import Path
import shutil

from hypothesis import given, settings, strategies as st
import pytest
from readers import folder, read

CORPUS = [path.read_bytes() for path in sorted((Path(__file__).parent / 'corpus').iterdir())]


@pytest.fixture(autouse=True, scope='module')
def cleaned() -> Iterator[None]:
    """Leave no files: workers of pytest-xdist end without what is registered for their exit."""
    yield
    shutil.rmtree(folder())


@settings(max_examples=150, deadline=None)
@given(data=st.data())
def test_cut_and_flipped(data: st.DataObject) -> None:
    """Whatever is cut off or flipped, nothing escapes but our own error."""
    whole = bytearray(data.draw(st.sampled_from(CORPUS)))
    if whole[:1] == b'M' and data.draw(st.booleans()):
        whole[:1] = b'S'
    for place in data.draw(st.lists(st.integers(8, 8 * len(whole) - 1), max_size=8)):
        whole[place // 8] ^= 1 << place % 8
    read(bytes(whole[:data.draw(st.integers(1, len(whole)))]))


def test_the_corpus_is_read() -> None:
    """Nothing in it is refused."""
    assert len(CORPUS) == 8
    assert [read(data) for data in CORPUS] == [''] * 8
    assert all(read(b'S' + data[1:]) == '' for data in CORPUS if data[:1] == b'M')


@pytest.mark.parametrize('text', [
    '[' * 1200, 'a: 2001-99-99', '- 1', '!!int x: 1', '!!float "": 1', '!!timestamp x', '\x00',
    'rosbag2_bagfile_information: {storage_identifier: [a, b]}', '!!python/object:os.system x'])
def test_metadata_that_is_none(text: str) -> None:
    """What yaml itself trips over is refused as well, naming the file."""
    assert 'metadata.yaml: ' in read(b'Y' + text.encode())
