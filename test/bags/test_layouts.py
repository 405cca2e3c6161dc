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

"""Bags of any layout that the MCAP specification allows, and of rosbag2's own compressions."""

from collections.abc import Iterator, Sequence
import dataclasses
import io
import itertools
from pathlib import Path
import types

from bag_maker import batches, START, states, STEP, story, topic
from mcap.reader import make_reader
from mcap_maker import Layout, make_channel, make_schema, Sent, text, Writer
import numpy as np
import pytest
import zstandard

from gear_rattle_ros.bags import Bag, BagError, read_bag
from gear_rattle_ros.bags.recover import recover
from gear_rattle_ros.bags.verify import verify
from gear_rattle_ros.cli.bags import recover as recover_command, verify as verify_command
from gear_rattle_ros.figures.digest import digest_of
from gear_rattle_ros.nodes.base.errors import UserError
from gear_rattle_ros.nodes.replay.node import Replay
from gear_rattle_ros.nodes.replay.playing import Playing, Span

EVENTS = story(400)
CLOUDS = batches(EVENTS, 50)
STATES = states(9)
CLOUD, STATE = (topic(name, kind) for name, kind in (
    ('/impacts', 'sensor_msgs/msg/PointCloud2'), ('/joint_states', 'sensor_msgs/msg/JointState')))
SCHEMAS = [make_schema(number, known.type_name, known.definition.encode())
           for number, known in enumerate((CLOUD, STATE), 1)]
CHANNELS = [make_channel(number, number, known.name, topic_type_hash=known.type_hash,
                         offered_qos_profiles='[]')
            for number, known in enumerate((CLOUD, STATE), 1)]
TIMES = [START + number * STEP for number in range(9)]
SECOND = 1_000_000_000

ALL = [Layout(**dict(zip(('padding', 'repeated', 'statistics', 'offsets', 'chunk_index',
                          'message_index'), kinds, strict=True)),
              chunks=compression != 'loose', compression=compression.removesuffix('loose'))
       for compression in ('loose', '', 'lz4', 'zstd')
       for kinds in itertools.product((False, True), repeat=6)
       # Without chunks they have no index.
       if compression != 'loose' or kinds[4:] == (False, False)]
SPECIAL = [
    Layout(frames=3), Layout(frames=3, checksum=False), Layout(compression='lz4', frames=2),
    Layout(loose=5), Layout(between=3), Layout(loose=5, between=1, chunk_index=False),
    Layout(loose=1, statistics=False),
    Layout(private=True), Layout(private=True, chunks=False), Layout(private=True, padding=True),
    Layout(in_chunk=1), Layout(in_chunk=100), Layout(loose=17, repeated=False, padding=True),
]


def messages(times: Sequence[int] = TIMES, sequences: Sequence[int] = range(9)) -> list[Sent]:
    """Return the clouds, at some times, each with a state of half a step later."""
    return [sent for number, time in enumerate(times) for sent in (
        Sent(1, sequences[number], time, CLOUDS[number]),
        Sent(2, sequences[number], time + STEP // 2, STATES[number]))]


def written(path: Path, layout: Layout, sent: Sequence[Sent] | None = None) -> Path:
    """Write a file of a layout."""
    path.write_bytes(Writer(layout).write(SCHEMAS, CHANNELS, messages() if sent is None else sent))
    return path


def played(path: Path, speed: float = 0.0, limit: int | None = None) -> list[tuple[str, bytes]]:
    """Return what the thread of replay publishes, without any node."""
    bag = Bag(path)
    found: list[tuple[str, bytes]] = []

    def output(name: str) -> types.SimpleNamespace:
        return types.SimpleNamespace(
            publisher=types.SimpleNamespace(get_subscription_count=lambda: 1),
            is_clear=lambda _: True, may_publish=lambda: True,
            publish=lambda data: found.append((name, data)))

    playing = Playing(bag, {name: output(name) for name in bag.topics},
                      Span(bag.start, limit or bag.end, speed, False), 1, None)
    playing._thread.join(20.0)
    assert playing.is_over
    if playing.failure:
        raise BagError(playing.failure)
    return found


EXPECTED = [pair for cloud, state in zip(CLOUDS, STATES, strict=True)
            for pair in (('/impacts', cloud), ('/joint_states', state))]


def check(path: Path, output: Path) -> None:
    """See that verify, recover, summary and replay find all that was written."""
    verdict = verify(path)
    assert verdict.is_verified and verdict.is_whole, str(verdict)
    assert (verdict.events, verdict.flights, verdict.runs) == (401, 400, 1)
    recovery = recover(path, output)
    assert recovery.messages == 18 and len(str(recovery).splitlines()) == 2, str(recovery)
    assert '401 events' in str(recovery)
    for each in (path, output):
        bag = Bag(each)
        assert bag.counts == {'/impacts': 9, '/joint_states': 9} and bag.is_whole
        assert [(m.topic, m.data) for m in bag.messages()] == EXPECTED
        assert {name: known.type_hash for name, known in bag.topics.items()} == {
            known.name: known.type_hash for known in (CLOUD, STATE)}
    digest = digest_of(Bag(path).events())
    assert digest.impacts == 399 and len(digest.points.rows) == 399 and not digest.guard.gaps
    assert played(path) == EXPECTED
    assert read_bag(path).tobytes() == EVENTS.tobytes()


@pytest.mark.parametrize('layout', [*SPECIAL, *ALL[::37]], ids=str)
def test_a_layout_is_read_whole(layout: Layout, tmp_path: Path) -> None:
    """Some of the matrix, and what it does not have."""
    check(written(tmp_path / 'bag.mcap', layout), tmp_path / 'out')


@pytest.mark.long
@pytest.mark.parametrize('layout', ALL, ids=str)
def test_the_matrix_of_layouts(layout: Layout, tmp_path: Path) -> None:
    """Each combination of chunks, compressions, indexes, repetitions and extended records."""
    check(written(tmp_path / 'bag.mcap', layout), tmp_path / 'out')


@pytest.mark.parametrize('compression', ['', 'lz4', 'zstd'])
@pytest.mark.parametrize('chunks', [True, False])
def test_the_layouts_are_those_of_the_specification(chunks: bool, compression: str) -> None:
    """What the tests write is what mcap's own reader reads, where it can."""
    data = Writer(Layout(chunks=chunks, compression=compression)).write(
        SCHEMAS, CHANNELS, messages())
    reader = make_reader(io.BytesIO(data), validate_crcs=True)
    found = [(channel.topic, message.data) for _, channel, message in reader.iter_messages()]
    assert found == EXPECTED
    assert reader.get_summary().statistics.channel_message_counts == {1: 9, 2: 9}


@pytest.mark.parametrize(('layout', 'words'), [
    (Layout(count_error=3), 'states 21 messages, but has 18'),
    (Layout(count_error=-3, channel_error=-3), 'states 15 messages, but has 18'),
    (Layout(channel_error=-1), 'states 8 messages on /impacts, but has 9'),
    (Layout(chunk_error=2), 'states 7 chunks, but has 5'),
    (Layout(lost_chunk=True), 'states 6 chunks, but has 5'),
    (Layout(index_error=9), r'the index states \d+ bytes in the chunk .* that states \d+'),
    (Layout(size_error=9), r'states \d+ bytes, but has \d+'),
    (Layout(size_error=-9), r'states \d+ bytes, but has more'),
    (Layout(chunks=False, count_error=1), 'states 19 messages, but has 18'),
], ids=str)
def test_what_is_stated_is_held_against_what_is_there(
        layout: Layout, words: str, tmp_path: Path) -> None:
    """One line with both numbers from each reader; recover reports both."""
    path = written(tmp_path / 'bag.mcap', layout)
    for read in (verify, read_bag, played, lambda file: digest_of(Bag(file).events())):
        with pytest.raises(BagError, match=words) as caught:
            read(path)
        assert '\n' not in str(caught.value)
    assert verify_command.main([str(path)]) == 2
    if layout.index_error:
        assert recover(path, tmp_path / 'out').messages == 18
    if layout.count_error:
        report = str(recover(path, tmp_path / 'out'))
        assert f'states {18 + layout.count_error} messages, but has 18' in report


def test_what_comes_after_the_end_is_not_left_out_silently(tmp_path: Path) -> None:
    """Two files in one, a compression that nobody knows, and a channel with two meanings."""
    path = written(tmp_path / 'bag.mcap', Layout())
    whole = path.read_bytes()
    path.write_bytes(2 * whole)
    size = len(whole)
    with pytest.raises(BagError, match=f'has {size} bytes after its end at byte {size}'):
        verify(path)
    assert f'{size:,} bytes from {size} on unreadable' in str(
        recover(path, tmp_path / 'out'))
    path.write_bytes(whole.replace(b'\x04\0\0\0zstd', b'\x04\0\0\0zstx'))
    with pytest.raises(BagError, match="compressed with b'zstx', not with zstd or lz4"):
        verify(path)
    whole = written(path, Layout(compression='')).read_bytes()
    place = whole.rindex(b'/impacts')
    path.write_bytes(whole[:place] + b'/iMpacts' + whole[place + 8:])
    with pytest.raises(BagError, match='channel 1 is not described, or in two ways'):
        next(Bag(path).messages())


def test_nothing_but_magic(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One clear line, status 2."""
    (tmp_path / 'bag.mcap').write_bytes(b'\x89MCAP0\r\n')
    assert verify_command.main([str(tmp_path / 'bag.mcap')]) == 2
    assert 'nothing was recorded in it' in capsys.readouterr().err
    assert recover_command.main([str(tmp_path / 'bag.mcap')]) == 2
    assert 'nothing in it can be recovered' in capsys.readouterr().err
    # The smallest file of the specification is a bag without topics.
    (tmp_path / 'bag.mcap').write_bytes(Writer(Layout(
        repeated=False, statistics=False)).write([], [], []))
    bag = Bag(tmp_path / 'bag.mcap')
    assert bag.is_whole and not bag.topics and [*bag.messages()] == []


def mixed(values: Sequence[int], order: Sequence[int]) -> list[int]:
    return [values[number] for number in order]


@pytest.mark.parametrize('layout', [
    Layout(in_chunk=3), Layout(in_chunk=100), Layout(chunks=False),
], ids=['chunks', 'chunk', 'loose'])
@pytest.mark.parametrize(('times', 'set_back'), [
    ([time - (3600 * SECOND if number > 3 else 0) for number, time in enumerate(TIMES)], 3600),
    ([*TIMES[:8], 2**64 - 1000], 0),
    ([2**63, *TIMES[1:]], 0),
    ([START] * 9, 0),
    ([0] * 9, 0),
    (TIMES[::-1], 0.08),
    ([START + 3600 * SECOND * (number % 2) for number in range(9)], 3600),
], ids=['back', 'beyond', 'first beyond', 'equal', 'zero', 'reversed', 'to and fro'])
def test_log_times_may_do_anything(
        layout: Layout, times: list[int], set_back: float, tmp_path: Path) -> None:
    """The order of a topic is that of the file, and replay does not wait for what never was."""
    sent = [message if message.channel == 1 else dataclasses.replace(
        message, time=min(message.time, 2**64 - 1)) for message in messages(times)]
    path = written(tmp_path / 'bag.mcap', layout, sent)
    verdict = verify(path)
    assert verdict.is_verified and (verdict.flights, verdict.runs) == (400, 1)
    assert verdict.set_back == pytest.approx(set_back * SECOND, rel=1e-4)
    assert ('log times go back' in str(verdict)) == bool(set_back)
    assert recover(path, tmp_path / 'out').messages == 18
    for each in (path, tmp_path / 'out'):
        bag = Bag(each)
        found = [*bag.messages()]
        assert [m.data for m in found if m.topic == '/impacts'] == CLOUDS
        assert [m.data for m in found if m.topic == '/joint_states'] == STATES
        assert [m.time for m in found] == sorted(m.time for m in found)
        assert found[0].time - STEP * 8 <= bag.start <= found[0].time
        assert bag.end == found[-1].time
        assert sorted(m.log_time for m in found) == sorted(s.time for s in sent)
        assert len(played(each)) == 18
        if set_back != 3600 or times[1] < START + SECOND:
            assert bag.end - bag.start <= 9 * STEP
            assert len(played(each, 10.0)) == 18


@pytest.mark.parametrize('order', [[1, 0, 2, 4, 3, 5, 8, 7, 6], [8, *range(8)]])
@pytest.mark.parametrize('times', [TIMES, [START] * 9])
def test_messages_written_late_are_put_in_order(
        times: list[int], order: list[int], tmp_path: Path) -> None:
    """Their sequence numbers say so, and their log times do not contradict."""
    sent = messages(times)
    late = [sent[2 * number + offset] for number in order for offset in (0, 1)]
    path = written(tmp_path / 'bag.mcap', Layout(in_chunk=3), late)
    assert verify(path).is_verified
    assert [m.data for m in Bag(path).messages(['/joint_states'])] == STATES


def test_the_clock_set_back_between_two_files(tmp_path: Path) -> None:
    """They follow each other as metadata.yaml names them."""
    for number, back in enumerate((0, 3600 * SECOND)):
        some = messages([time - back for time in TIMES])
        written(tmp_path / f'bag_{number}.mcap', Layout(), some[10 * number:10 + 8 * number])
    assert verify(tmp_path).is_verified
    bag = Bag(tmp_path)
    assert [(m.topic, m.data) for m in bag.messages()] == EXPECTED
    assert bag.end - bag.start < 9 * STEP and bag.counts == {'/impacts': 9, '/joint_states': 9}


def metadata(directory: Path, name: str, mode: str, form: str = 'zstd',
             storage: str = 'mcap') -> None:
    """Write what rosbag2 writes beside its file, as far as it is read."""
    (directory / 'metadata.yaml').write_text(
        'rosbag2_bagfile_information: {version: 9, storage_identifier: "' + storage + '", '
        f'compression_format: "{form}", compression_mode: "{mode}", '
        f'relative_file_paths: ["{name}"]}}')


@pytest.mark.parametrize('is_named', [True, False])
@pytest.mark.parametrize('mode', ['FILE', 'MESSAGE', 'NONE', ''])
def test_compressed_by_rosbag2(mode: str, is_named: bool, tmp_path: Path) -> None:
    """A file, or each message by itself; with metadata.yaml, and the file alone."""
    bag = tmp_path / 'bag'
    bag.mkdir()
    pack = zstandard.ZstdCompressor().compress
    sent = [dataclasses.replace(each, data=pack(each.data)) if mode == 'MESSAGE' else each
            for each in messages()]
    path = written(bag / 'bag_0.mcap', Layout(compression=''), sent)
    if mode == 'FILE':
        data = path.read_bytes()
        path.with_name('bag_0.mcap.zstd').write_bytes(pack(data[:40_000]) + pack(data[40_000:]))
        path.unlink()
        path = path.with_name('bag_0.mcap.zstd')
    if is_named:
        metadata(bag, path.name, mode, storage='' if mode == 'NONE' else 'mcap')
    check(bag, tmp_path / 'out')
    check(path, tmp_path / 'other')
    if mode == 'FILE':
        path.write_bytes(path.read_bytes()[:-300])
        assert not Bag(bag).is_whole
        assert 'was not closed properly' in str(recover(bag, tmp_path / 'cut'))
    if mode == 'MESSAGE':
        # A message that cannot be decompressed is no message.
        sent[4] = dataclasses.replace(sent[4], data=sent[4].data[:-20])
        written(path, Layout(compression=''), sent)
        with pytest.raises(BagError, match='is damaged'):
            verify(bag)
        assert 'states 18 messages, but has 17' in str(recover(bag, tmp_path / 'cut'))


@pytest.mark.parametrize('is_in_file', [True, False])
def test_compressed_by_a_plugin(is_in_file: bool, tmp_path: Path) -> None:
    """What is not zstd is named, with the remedy, and nothing is taken for messages."""
    bag = tmp_path / 'bag'
    bag.mkdir()
    path = written(bag / 'bag_0.mcap', Layout())
    metadata(bag, path.name, 'MESSAGE', 'fancy')
    if is_in_file:
        content = (bag / 'metadata.yaml').read_text().partition('information: ')[2]
        (bag / 'metadata.yaml').unlink()
        writer = Writer(Layout())
        record = writer.record(12, text('rosbag2') + len(
            text('serialized_metadata') + text(content)).to_bytes(4, 'little')
            + text('serialized_metadata') + text(content))
        # In front of everything else: no index is needed to find it.
        path.write_bytes(writer.out + record + Writer(Layout(chunk_index=False)).write(
            SCHEMAS, CHANNELS, messages())[8:])
    for read in (verify, read_bag, played, lambda file: recover(file, tmp_path / 'out')):
        with pytest.raises(BagError, match='MESSAGE with fancy.*ros2 bag convert'):
            read(bag)
    assert not (tmp_path / 'out').exists()


def test_no_schema_and_no_type(tmp_path: Path) -> None:
    """Schema 0, other encodings and types that are not installed: kept, and left out by replay."""
    schemas = [*SCHEMAS, make_schema(3, 'rosbag2_interfaces/msg/Unheard', b'string x'),
               make_schema(0, 'invalid/msg/Schema', b'')]
    channels = [*CHANNELS, make_channel(3, 0, '/note', 'json'),
                make_channel(4, 3, '/events/split')]
    sent = [*messages(), Sent(3, 0, TIMES[-1] + STEP, b'{"a": 1}')]
    path = tmp_path / 'bag.mcap'
    path.write_bytes(Writer(Layout()).write(schemas, channels, sent))
    assert verify(path).is_verified
    assert recover(path, tmp_path / 'out').messages == 19
    for each in (path, tmp_path / 'out'):
        topics = Bag(each).topics
        assert (topics['/note'].type_name, topics['/note'].serialization) == ('', 'json')
        assert topics['/impacts'].type_name == 'sensor_msgs/msg/PointCloud2'
        assert dict(played(each))['/note'] == b'{"a": 1}'
    with (tmp_path / 'out' / 'out_0.mcap').open('rb') as stream:
        found = {channel.topic: (schema, channel.message_encoding)
                 for schema, channel, _ in make_reader(stream).iter_messages()}
    assert found['/note'] == (None, 'json')
    lines: list[str] = []
    node = types.SimpleNamespace(
        _bag=Bag(path), values={'topics': '', 'clock': False},
        get_logger=lambda: types.SimpleNamespace(warning=lines.append))
    assert set(Replay._choose(node)) == {'/impacts', '/joint_states'}
    assert len(lines) == 1
    assert '/note (no type, json), /events/split (rosbag2_interfaces/msg/Unheard, cdr)' in lines[0]
    node.values['topics'] = '/impacts /note'
    with pytest.raises(UserError, match='cannot publish /note'):
        Replay._choose(node)


def test_events_without_a_schema(tmp_path: Path) -> None:
    """Their topic is known by its name."""
    path = tmp_path / 'bag.mcap'
    path.write_bytes(Writer(Layout()).write([], [
        make_channel(1, 0, '/impacts'), make_channel(2, 0, '/joint_states')], messages()))
    assert verify(path).is_verified
    node = types.SimpleNamespace(_bag=Bag(path), values={'topics': '', 'clock': False})
    with pytest.raises(UserError, match=r'cannot publish /impacts \(no type, cdr\), /joint'):
        Replay._choose(node)
    assert '401 events' in str(recover(path, tmp_path / 'out'))
    assert read_bag(tmp_path / 'out').tobytes() == EVENTS.tobytes()


def cuts(size: int) -> Iterator[int]:
    """Return some lengths, more of them near the end."""
    yield from range(size - 120, size - 1, 7)
    yield from range(9, size, size // 60)


@pytest.mark.parametrize('layout', [Layout(loose=5), Layout(chunks=False, padding=True),
                                    Layout(compression='', private=True, repeated=False)], ids=str)
def test_a_cut_file_of_any_layout(layout: Layout, tmp_path: Path) -> None:
    """What is read is a beginning, that it is one is reported, and recover finds the same."""
    whole = written(tmp_path / 'bag.mcap', layout).read_bytes()
    path = tmp_path / 'cut.mcap'
    most = 0
    for number, size in enumerate(cuts(len(whole))):
        path.write_bytes(whole[:size])
        bag = Bag(path)
        found = [(m.topic, m.data) for m in bag.messages()]
        assert not bag.is_whole and found == EXPECTED[:len(found)]
        most = max(most, len(found))
        if found and not number % 8:
            assert recover(path, tmp_path / f'out_{size}').messages == len(found)
    assert most == 18


def test_extended_numbers_of_lengths(tmp_path: Path) -> None:
    """A length that swallows a chunk is noticed, and recover finds the chunk by the index."""
    whole = bytearray(written(tmp_path / 'bag.mcap', Layout()).read_bytes())
    with (tmp_path / 'bag.mcap').open('rb') as stream:
        index = make_reader(stream).get_summary().chunk_indexes
    end = index[0].chunk_start_offset + index[0].chunk_length
    swallowed = index[1].chunk_start_offset + index[1].chunk_length - end - 9
    whole[end + 1:end + 9] = swallowed.to_bytes(8, 'little')
    (tmp_path / 'bag.mcap').write_bytes(whole)
    with pytest.raises(BagError, match='states 5 chunks, but has 4'):
        verify(tmp_path / 'bag.mcap')
    assert recover(tmp_path / 'bag.mcap', tmp_path / 'out').messages == 18
    assert np.concatenate([*Bag(tmp_path / 'out').events()]).tobytes() == EVENTS.tobytes()
