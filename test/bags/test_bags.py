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

"""Bags: what other readers find in ours, and what ours makes of damaged ones."""

import itertools
from pathlib import Path
import subprocess
import sys

from bag_maker import batches, make_bag, START, states, STEP, story, topic, TYPES
from hypothesis import given, settings, strategies
from mcap.reader import make_reader, NonSeekingReader
import numpy as np
import pandas
import pytest
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import Reader
import yaml

from gear_rattle_ros.bags import (
    Bag,
    BagError,
    BagWriter,
    CloudDecoder,
    message_definition,
    read_bag,
)
from gear_rattle_ros.bags.recover import recover
from gear_rattle_ros.core.model import EVENT, impact_count

EVENTS = story()
CLOUDS = batches(EVENTS)
STATES = states(20)


@pytest.fixture(scope='module')
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a bag of 51 clouds and 20 states."""
    path = tmp_path_factory.mktemp('bags') / 'whole'
    make_bag(path, CLOUDS, STATES)
    return path


def columns_of(cloud) -> dict[str, np.ndarray]:
    """Return the fields of a cloud that rosbags has decoded, by their own description."""
    kinds = {6: '<u4', 7: '<f4', 8: '<f8'}
    data = np.asarray(cloud.data).reshape(cloud.width * cloud.height, cloud.point_step)
    return {
        field.name: np.ascontiguousarray(
            data[:, field.offset:field.offset + int(kinds[field.datatype][2])]
        ).view(kinds[field.datatype])[:, 0]
        for field in cloud.fields
    }


def test_rosbags_finds_the_events_bit_for_bit(bag: Path) -> None:
    """An independent reader, with the definitions in the bag, decodes what was simulated."""
    with AnyReader([bag]) as reader:
        assert {(c.topic, c.msgtype, c.msgcount) for c in reader.connections} == {
            ('/impacts', 'sensor_msgs/msg/PointCloud2', len(CLOUDS)),
            ('/lyapunov', 'sensor_msgs/msg/JointState', len(STATES))}
        clouds = [
            reader.deserialize(data, connection.msgtype)
            for connection, _, data in reader.messages() if connection.topic == '/impacts']
    for name in EVENT.names or ():
        found = np.concatenate([columns_of(cloud)[name] for cloud in clouds])
        assert found.dtype == EVENT[name]
        assert found.tobytes() == EVENTS[name].tobytes(), name
    assert [cloud.header.stamp.sec for cloud in clouds] == list(range(0, len(EVENTS), 100))


def test_metadata_agrees_with_the_statistics_of_the_file(bag: Path) -> None:
    """metadata.yaml, the file's own statistics and rosbags agree."""
    text = (bag / 'metadata.yaml').read_text()
    information = yaml.safe_load(text)['rosbag2_bagfile_information']
    with (bag / 'whole_0.mcap').open('rb') as stream:
        reader = make_reader(stream, validate_crcs=True)
        assert reader.get_header().profile == 'ros2'
        summary = reader.get_summary()
        records = {record.name: record.metadata for record in reader.iter_metadata()}
        assert sum(1 for _ in reader.iter_messages()) == len(CLOUDS) + len(STATES)
    statistics = summary.statistics
    end = START + (len(CLOUDS) - 1) * STEP
    assert (statistics.message_start_time, statistics.message_end_time) == (START, end)
    assert information['starting_time'] == {'nanoseconds_since_epoch': START}
    assert information['duration'] == {'nanoseconds': end - START}
    assert information['message_count'] == statistics.message_count
    assert information['relative_file_paths'] == ['whole_0.mcap']
    assert {entry['topic_metadata']['name']: entry['message_count']
            for entry in information['topics_with_message_count']} == {
        channel.topic: statistics.channel_message_counts[number]
        for number, channel in summary.channels.items()}
    assert yaml.safe_load(records['rosbag2']['serialized_metadata']) == information
    assert '&' not in text, 'other parsers of YAML do not all know aliases'
    for channel in summary.channels.values():
        offered = yaml.safe_load(channel.metadata['offered_qos_profiles'])
        assert offered[0]['reliability'] == 'reliable'
    with Reader(bag) as other:
        assert other.message_count == len(CLOUDS) + len(STATES)
        assert other.connections[0].ext.offered_qos_profiles[0].reliability.name == 'RELIABLE'


@pytest.mark.parametrize('name', [
    'sensor_msgs/msg/PointCloud2', 'sensor_msgs/msg/JointState', 'sensor_msgs/msg/Image',
    'diagnostic_msgs/msg/DiagnosticArray', 'rosgraph_msgs/msg/Clock',
])
def test_definitions_name_the_same_types_as_rosbags(name: str) -> None:
    """The concatenated definition holds the type and everything that it is made of, once."""
    text = message_definition(name, lambda package: f'{sys.prefix}/share/{package}')
    expected, _ = TYPES.generate_msgdef(name, ros_version=2)
    heads = [[line for line in source.splitlines() if line.startswith('MSG: ')]
             for source in (text, expected)]
    assert sorted(heads[0]) == sorted(heads[1])


def test_rerun_imports_the_bag(bag: Path, tmp_path: Path) -> None:
    """Its importer makes a row of every message."""
    from rerun.chunk import RrdReader
    target = tmp_path / 'bag.rrd'
    program = Path(sys.executable).with_name('rerun')
    subprocess.run([program, 'mcap', 'convert', bag / 'whole_0.mcap', '-o', target], check=True,
                   capture_output=True)
    rows: dict[str, int] = {}
    for chunk in RrdReader(target).stream():
        path = str(chunk.entity_path)
        rows[path] = rows.get(path, 0) + chunk.num_rows
    assert rows['/impacts'] >= len(CLOUDS)
    assert rows['/lyapunov'] >= len(STATES)


def test_messages_come_back_in_order(bag: Path) -> None:
    """All of them, with their bytes and times, sorted by log time."""
    opened = Bag(bag)
    messages = list(opened.messages())
    times = [message.log_time for message in messages]
    assert times == sorted(times)
    assert opened.is_whole
    assert (opened.start, opened.end) == (times[0], times[-1])
    impacts = [message for message in messages if message.topic == '/impacts']
    assert [message.data for message in impacts] == CLOUDS
    assert [message.sequence for message in impacts] == list(range(len(CLOUDS)))
    assert {message.log_time - message.publish_time for message in impacts} == {1000}
    assert [m.data for m in messages if m.topic == '/lyapunov'] == STATES
    assert np.concatenate(list(opened.events())).tobytes() == EVENTS.tobytes()
    some = list(opened.messages(['/lyapunov'], START + 2 * STEP, START + 4 * STEP + STEP // 2))
    assert [message.data for message in some] == STATES[2:5]
    assert [m.data for m in Bag(bag / 'whole_0.mcap').messages(['/impacts'])] == CLOUDS


@pytest.mark.parametrize('compression', ['zstd', 'lz4', 'none'])
def test_a_cut_file_gives_its_whole_chunks(tmp_path: Path, compression: str) -> None:
    """Wherever it is cut, what comes back is a beginning, in order."""
    make_bag(tmp_path / 'bag', CLOUDS, STATES, compression=compression)
    file = tmp_path / 'bag' / 'bag_0.mcap'
    whole = file.read_bytes()
    everything = list(Bag(file).messages())
    with file.open('rb') as stream:
        index = make_reader(stream).get_summary().chunk_indexes
    ends = [chunk.chunk_start_offset + chunk.chunk_length for chunk in index]
    # Every cut through the head of a record too: nine bytes after the end of a chunk.
    sizes = {*range(100, len(whole) - 1, len(whole) // 40), *(ends[0] + i for i in range(10))}
    for size in sorted(sizes):
        file.write_bytes(whole[:size])
        opened = Bag(tmp_path / 'bag')
        found = list(opened.messages())
        assert not opened.is_whole
        expected = []
        chunks = sum(end <= size for end in ends)
        if chunks:
            # Chunks close after ten clouds and the states among them.
            kept = {(m.topic, m.sequence) for m in everything if m.sequence < 10 * chunks}
            expected = [m for m in everything if (m.topic, m.sequence) in kept]
        assert found == expected, size
        assert sum(opened.counts.values()) == len(found)


def test_a_growing_bag_can_be_read(tmp_path: Path) -> None:
    """After a flush, another process sees what has been written, and metadata.yaml agrees."""
    writer = BagWriter(tmp_path / 'bag')
    channel = writer.add_topic(topic('/impacts', 'sensor_msgs/msg/PointCloud2'))
    for number, cloud in enumerate(CLOUDS):
        writer.write(channel, START + number, START, number, cloud)
        if number in (0, 7):
            writer.flush()
            writer.write_metadata()
            assert len(list(Bag(tmp_path / 'bag').messages())) == number + 1
            text = (tmp_path / 'bag' / 'metadata.yaml').read_text()
            assert yaml.safe_load(text)['rosbag2_bagfile_information']['message_count'] == \
                number + 1
    assert writer.abandon() == 8
    assert [message.data for message in Bag(tmp_path / 'bag').messages()] == CLOUDS[:8]
    with (tmp_path / 'bag' / 'bag_0.mcap').open('rb') as stream:
        found = NonSeekingReader(stream).iter_messages(log_time_order=False)
        assert [message.data for _, _, message in itertools.islice(found, 8)] == CLOUDS[:8]


@pytest.mark.parametrize('splits', [{'longest': 10 * STEP}, {'largest': 20_000}])
def test_a_bag_of_several_files(tmp_path: Path, splits: dict[str, int]) -> None:
    """Ours, rosbags and mcap's own reader find the same in them as in a bag of one file."""
    make_bag(tmp_path / 'one', CLOUDS, STATES)
    make_bag(tmp_path / 'bag', CLOUDS, STATES, **splits)
    text = (tmp_path / 'bag' / 'metadata.yaml').read_text()
    information = yaml.safe_load(text)['rosbag2_bagfile_information']
    names = information['relative_file_paths']
    assert len(names) >= 5 and names == [f'bag_{number}.mcap' for number in range(len(names))]
    for entry in information['files']:
        with (tmp_path / 'bag' / entry['path']).open('rb') as stream:
            reader = make_reader(stream, validate_crcs=True)
            statistics = reader.get_summary().statistics
            assert sum(1 for _ in reader.iter_messages()) == entry['message_count']
        start = entry['starting_time']['nanoseconds_since_epoch']
        assert statistics.message_start_time == start
        assert statistics.message_end_time == start + entry['duration']['nanoseconds']
        assert not splits.get('longest', 0) or entry['duration']['nanoseconds'] <= 10 * STEP
    both = [Bag(tmp_path / name) for name in ('one', 'bag')]
    one, several = ([*bag.messages()] for bag in both)
    assert several == one
    assert both[0].counts == both[1].counts and both[1].is_whole
    assert (both[0].start, both[0].end) == (both[1].start, both[1].end)
    with AnyReader([tmp_path / 'bag']) as reader:
        assert [(c.topic, time, data) for c, time, data in reader.messages()] == [
            (m.topic, m.log_time, m.data) for m in one]
    recover(tmp_path / 'bag', tmp_path / 'again')
    assert [*Bag(tmp_path / 'again').messages()] == one


@pytest.mark.parametrize('moment', ['BagFile.finish', 'BagFile.__init__', 'BagFile.add_topic',
                                    'BagWriter.write_metadata'])
@pytest.mark.parametrize('is_killed', [True, False])
def test_nothing_is_lost_between_two_files(
        tmp_path: Path, moment: str, is_killed: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Killed, or the disk full, before each step of the change, or just after the last one."""
    writer = BagWriter(tmp_path / 'bag', longest=10 * STEP)
    channel = writer.add_topic(topic('/impacts', 'sensor_msgs/msg/PointCloud2'))
    for number, cloud in enumerate(CLOUDS[:10]):
        writer.write(channel, START + number * STEP, START, number, cloud)
    writer.flush()

    def fail(*_: object) -> None:
        raise OSError(28, 'No space left on device')

    with monkeypatch.context() as patch:
        patch.setattr(f'gear_rattle_ros.bags.writer.{moment}', fail)
        with pytest.raises(BagError, match='No space left on device'):
            writer.write(channel, START + 10 * STEP, START, 10, CLOUDS[10])
    if not is_killed:
        assert writer.abandon() == 10
    assert [message.data for message in Bag(tmp_path / 'bag').messages()] == CLOUDS[:10]


@pytest.mark.filterwarnings('error')
def test_a_bag_becomes_a_table(bag: Path, tmp_path: Path) -> None:
    """One array of a directory or a file; pandas and rosbags find the same columns."""
    found = read_bag(str(bag))
    assert found.dtype == EVENT and found.tobytes() == EVENTS.tobytes()
    assert read_bag(bag / 'whole_0.mcap', topic='/impacts').tobytes() == EVENTS.tobytes()
    table = pandas.DataFrame(found)
    with AnyReader([bag]) as reader:
        clouds = [columns_of(reader.deserialize(data, connection.msgtype))
                  for connection, _, data in reader.messages() if connection.topic == '/impacts']
    assert tuple(table.columns) == EVENT.names
    for name, column in table.items():
        expected = np.concatenate([cloud[name] for cloud in clouds])
        assert column.dtype == expected.dtype
        np.testing.assert_array_equal(column.to_numpy(), expected)
    with pytest.raises(BagError, match='has no topic /nothing'):
        read_bag(bag, topic='/nothing')
    make_bag(tmp_path / 'empty', [])
    assert read_bag(tmp_path / 'empty').shape == (0,)


def test_what_is_missing_of_a_table_is_a_warning(bag: Path, tmp_path: Path) -> None:
    """A hole, a new beginning and a file that was cut off; what is there is returned."""
    make_bag(tmp_path / 'holed', [*CLOUDS[:3], *CLOUDS[5:8], CLOUDS[0]])
    with pytest.warns(UserWarning) as caught:
        found = read_bag(tmp_path / 'holed')
    assert found['index'].tolist() == [
        *EVENTS['index'][:300], *EVENTS['index'][500:800], *EVENTS['index'][:100]]
    hole = f'{EVENTS["index"][300]} to {EVENTS["index"][499]} (epoch 0)'
    assert [str(warning.message) for warning in caught] == [
        f'{tmp_path / "holed"}: 1 hole, 200 impacts missing; the last hole: 200 impacts, {hole}',
        f'{tmp_path / "holed"}: the numbering begins anew 1 time']
    assert {warning.filename for warning in caught} == {__file__}
    (tmp_path / 'cut.mcap').write_bytes((bag / 'whole_0.mcap').read_bytes()[:-40])
    with pytest.warns(UserWarning, match='was not closed properly'):
        assert read_bag(tmp_path / 'cut.mcap').tobytes() == EVENTS.tobytes()


@pytest.mark.parametrize('is_little', [True, False])
def test_clouds_of_either_order_of_bytes(is_little: bool) -> None:
    """Another vendor's serializer, both orders, and the fields in another place."""
    native = TYPES.deserialize_cdr(CLOUDS[0], 'sensor_msgs/msg/PointCloud2')
    native.header.frame_id = 'another frame'
    decoder = CloudDecoder()
    for _ in range(2):
        for cdr in (TYPES.serialize_cdr(native, native.__msgtype__, little_endian=is_little),
                    CLOUDS[0]):
            assert decoder.events(bytes(cdr)).tobytes() == EVENTS[:100].tobytes()
    keys = decoder.columns(CLOUDS[1], ('kind', 'index'))
    assert keys['index'].tolist() == EVENTS['index'][100:200].tolist()
    assert impact_count(keys) == impact_count(EVENTS[100:200])


@given(strategies.integers(0, len(CLOUDS[0]) - 1), strategies.integers(0, 700),
       strategies.integers(1, 255))
@settings(max_examples=300, deadline=None)
def test_damaged_clouds_are_refused_or_read(cut: int, place: int, flip: int) -> None:
    """No bytes do more than raise ValueError."""
    damaged = bytearray(CLOUDS[0])
    damaged[place] ^= flip
    for cdr in (CLOUDS[0][:cut], bytes(damaged)):
        try:
            events = CloudDecoder().events(cdr)
        except ValueError:
            continue
        assert len(events) <= 100


def test_every_fault_is_one_line_that_names_the_file(bag: Path, tmp_path: Path) -> None:
    """Only BagError comes out, and it names the place."""
    (tmp_path / 'text.mcap').write_text('no bag, just some words')
    (tmp_path / 'nothing.mcap').write_bytes(b'')
    (tmp_path / 'empty').mkdir()
    for name, text in (('other', 'rosbag2_bagfile_information: {storage_identifier: sqlite3}'),
                       ('odd', 'a: [1'), ('odder', '7')):
        (tmp_path / name).mkdir()
        (tmp_path / name / 'metadata.yaml').write_text(text)
    for name, words in (
        ('text.mcap', 'no MCAP file'), ('nothing.mcap', 'no MCAP file'), ('nowhere', 'not exist'),
        ('empty', 'no .mcap file'), ('other', 'sqlite3'), ('odd', 'not the metadata'),
        ('odder', 'not the metadata'),
    ):
        with pytest.raises(BagError, match=words) as caught:
            Bag(tmp_path / name)
        assert str(tmp_path / name) in str(caught.value)
        assert '\n' not in str(caught.value)
    damaged = bytearray((bag / 'whole_0.mcap').read_bytes())
    damaged[len(damaged) // 2] ^= 0xFF
    (tmp_path / 'damaged.mcap').write_bytes(damaged)
    with pytest.raises(BagError, match=r'damaged\.mcap: is damaged'):
        list(Bag(tmp_path / 'damaged.mcap').messages())
    with pytest.raises(BagError, match='exists already'):
        BagWriter(tmp_path / 'empty')
    with pytest.raises(BagError, match='cannot be made'):
        BagWriter(tmp_path / 'text.mcap' / 'bag')
    with pytest.raises(BagError, match='no topic /nothing; there are /impacts, /lyapunov'):
        next(Bag(bag).events('/nothing'))
    with pytest.raises(BagError, match='/lyapunov at'):
        next(Bag(bag).events('/lyapunov'))


def test_bags_need_no_ros() -> None:
    """The package is imported where no ROS is."""
    code = ('import sys; import gear_rattle_ros.bags; '
            'assert not {"rclpy", "sensor_msgs", "ament_index_python"} & set(sys.modules)')
    subprocess.run([sys.executable, '-c', code], check=True)
