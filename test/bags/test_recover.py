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

"""Bags cut off and damaged at random: what is recovered is read by other vendors' readers."""

import hashlib
from pathlib import Path

from bag_maker import batches, make_bag, states, story
from mcap.reader import make_reader
import numpy as np
import pytest
from rosbags.highlevel import AnyReader
import yaml

from gear_rattle_ros.bags import Bag
from gear_rattle_ros.bags.recover import recover
from gear_rattle_ros.cli.bags.recover import main


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    """Return a bag of several chunks."""
    make_bag(tmp_path / 'bag', batches(story(6000), 50), states(100), flush_every=10)
    return tmp_path / 'bag'


def contents(path: Path) -> list[tuple[str, int, bytes]]:
    """Return what rosbags reads, and see that mcap's own reader and metadata.yaml agree."""
    with AnyReader([path]) as reader:
        found = [(connection.topic, time, bytes(data))
                 for connection, time, data in reader.messages()]
        hashes = {c.topic: c.digest for c in reader.connections}
    file = path / f'{path.name}_0.mcap'
    with file.open('rb') as stream:
        reader = make_reader(stream, validate_crcs=True)
        summary = reader.get_summary()
        assert summary and summary.statistics
        assert summary.statistics.message_count == len(found)
        assert sorted(message.log_time for _, _, message in reader.iter_messages()) == sorted(
            time for _, time, _ in found)
    told = yaml.safe_load((path / 'metadata.yaml').read_text())['rosbag2_bagfile_information']
    assert told['message_count'] == len(found)
    assert told['version'] == 9
    for entry in told['topics_with_message_count']:
        described = entry['topic_metadata']
        assert hashes[described['name']] == described['type_description_hash']
        assert described['offered_qos_profiles'][0]['reliability'] == 'reliable'
        assert entry['message_count'] == sum(name == described['name'] for name, _, _ in found)
    return found


def digest(path: Path) -> str:
    """Return a digest of all files of a directory."""
    return hashlib.sha256(b''.join(
        file.read_bytes() for file in sorted(path.iterdir()))).hexdigest()


def test_a_whole_bag_comes_out_as_it_was(bag: Path) -> None:
    """Topics, hashes, qualities of service, times and bytes."""
    before = digest(bag)
    report = str(recover(bag, bag.parent / 'new')).splitlines()
    assert contents(bag.parent / 'new') == contents(bag)
    assert digest(bag) == before
    assert report == ['221 messages recovered',
                      '/impacts: 6,001 events, from impact 0, epoch 0, to impact 5999, epoch 1']


def test_a_cut_bag_is_recovered_up_to_the_cut(bag: Path) -> None:
    """Wherever it is cut, what is whole in front of the cut is in the new bag."""
    everything = contents(bag)
    file = bag / 'bag_0.mcap'
    whole = file.read_bytes()
    rng = np.random.default_rng(2)
    seen = 0
    for number, size in enumerate(sorted(rng.integers(len(whole) // 8, len(whole) - 20, 12))):
        file.write_bytes(whole[:size])
        if number % 2:
            (bag / 'metadata.yaml').unlink(missing_ok=True)
        output = bag.parent / f'cut_{number}'
        recovery = recover(bag, output)
        found = contents(output)
        assert found == [entry for entry in everything if entry in found]
        assert len(found) >= seen
        seen = len(found)
        assert recovery.unclosed == (file,)
        last = int(list(Bag(output).events())[-1]['index'][-1])
        assert f'/impacts: what came after impact {last} is lost' in str(recovery)
        assert file.read_bytes() == whole[:size]
    assert seen > 150


def test_flipped_bits_cost_the_chunk_they_are_in(bag: Path) -> None:
    """A flip anywhere, also in a length or the very first chunk; what is missing is reported."""
    everything = contents(bag)
    file = bag / 'bag_0.mcap'
    whole = file.read_bytes()
    rng = np.random.default_rng(3)
    places = [*rng.integers(0, len(whole), 6), *range(8, 60, 13)]
    for number, place in enumerate(places):
        damaged = bytearray(whole)
        damaged[place] ^= 1 << int(rng.integers(8))
        file.write_bytes(damaged)
        output = bag.parent / f'flipped_{number}'
        recovery = recover(bag, output)
        found = contents(output)
        assert [entry for entry in everything if entry in found] == found
        # A chunk has ten clouds and ten states at the most.
        assert len(found) >= len(everything) - 20, place
        events = sum(len(batch) for batch in Bag(output).events())
        lost = recovery.accounts['/impacts'].guard.lost
        if found[0][1] == everything[0][1] and found[-1][1] == everything[-1][1]:
            # The retune is an event and no impact.
            assert 6001 - events - lost in (0, 1)


def test_what_cannot_be_done_is_one_line(bag: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Status 2; nothing is overwritten or put into the bag."""
    before = digest(bag)
    (bag.parent / 'there').mkdir()
    (bag.parent / 'noise.mcap').write_bytes(bytes(range(256)) * 40)
    (bag.parent / 'empty.mcap').write_bytes(b'')
    for arguments, words in (
            ((bag, bag.parent / 'there'), 'exists already'),
            ((bag, bag / 'new'), 'lies in the bag'),
            ((bag.parent / 'none',), 'does not exist'),
            ((bag.parent / 'there',), 'has no .mcap file'),
            ((bag.parent / 'noise.mcap',), 'nothing in it can be recovered'),
            ((bag.parent / 'empty.mcap',), 'nothing in it can be recovered'),
            ((bag, Path('/proc/nowhere')), 'cannot be made')):
        assert main([str(argument) for argument in arguments]) == 2
        error = capsys.readouterr().err
        assert error.startswith('recover: ')
        assert words in error
        assert error.count('\n') == 1
    assert digest(bag) == before
    assert main([str(bag)]) == 0
    assert (bag.parent / 'bag_recovered' / 'bag_recovered_0.mcap').is_file()
    assert capsys.readouterr().out.splitlines()[-1] == str(bag.parent / 'bag_recovered')


def test_files_beside_the_bag_are_left_alone(bag: Path) -> None:
    """A metadata.yaml that names files elsewhere does not lead there."""
    path = bag / 'metadata.yaml'
    for name in ('../other.mcap', '/etc/passwd', '{a: b}'):
        path.write_text(path.read_text().replace('bag_0.mcap', name).replace(
            f'"{name}"', name))
        recovery = recover(bag, bag.parent / f'new_{len(name)}')
        assert recovery.messages == 221
