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

"""EVENT arrays as point clouds and back; stamps; joint states; diagnostics."""

import array
import math
import struct

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus
from hypothesis import given, strategies as st
import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message
import rclpy.time
from sensor_msgs.msg import JointState, PointCloud2, PointField

from gear_rattle_ros import messages
from gear_rattle_ros.core.flight.simulation import Simulation
from gear_rattle_ros.core.model import EVENT, EventArray, Parameters, State

STAMP = Time(sec=12, nanosec=34)


@pytest.fixture(autouse=True)
def _check_fields(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let every assignment to a message be checked."""
    monkeypatch.setenv('ROS_PYTHON_CHECK_FIELDS', '1')


def some_events(count: int = 500) -> EventArray:
    """Return the beginning of a run."""
    return Simulation(Parameters(1.2), State(2**31, 0.3, -0.5, 0.4)).advance(2**32, 0.0, count)


@pytest.mark.parametrize('count', [0, 1, 500])
def test_a_cloud_brings_the_events_back_bit_for_bit(count: int) -> None:
    """Through the message, and through its bytes on the wire."""
    events = some_events(501)[:count]
    cloud = messages.cloud_from_events(events, STAMP)
    assert messages.events_from_cloud(cloud).tobytes() == events.tobytes()
    wired = deserialize_message(serialize_message(cloud), PointCloud2)
    assert wired.header.stamp == STAMP and wired.header.frame_id == 'section'
    back = messages.events_from_cloud(wired)
    assert back.dtype == EVENT
    assert back.tobytes() == events.tobytes()


def test_what_is_drawn_is_the_section() -> None:
    """x, y, z are phase, velocity and displacement in float32, where viewers look for them."""
    events = some_events()
    cloud = messages.cloud_from_events(events, STAMP)
    offsets = {field.name: field.offset for field in cloud.fields}
    assert all(field.datatype == PointField.FLOAT32 for field in cloud.fields[:3])
    raw = np.frombuffer(cloud.data, np.uint8).reshape(cloud.width, cloud.point_step)
    for name, source in (('x', 'phase'), ('y', 'velocity'), ('z', 'displacement')):
        column = raw[:, offsets[name]:offsets[name] + 4].copy().view(np.float32)[:, 0]
        assert np.array_equal(column, events[source].astype(np.float32))
    assert (cloud.height, cloud.width, cloud.row_step) == (1, 500, 500 * cloud.point_step)
    assert isinstance(cloud.data, array.array)


def foreign(events: EventArray, order: str, names: list[str], pad: int = 3) -> PointCloud2:
    """Return a cloud as another program may lay it out: other order, packed, other fields."""
    layout = np.dtype({
        'names': [*names, 'intensity'],
        'formats': [*(EVENT[name].newbyteorder(order) for name in names), order + 'f4'],
        'offsets': list(pad + np.cumsum([0, *(EVENT[name].itemsize for name in names)])),
        'itemsize': pad + EVENT.itemsize + 11})
    points = np.zeros(len(events), layout)
    for name in names:
        points[name] = events[name]
    codes = {4: PointField.UINT32, 8: PointField.FLOAT64}
    fields = [PointField(name=name, offset=int(layout.fields[name][1]),
                         datatype=codes[EVENT[name].itemsize], count=1) for name in names]
    return PointCloud2(
        height=1, width=len(events), fields=fields, is_bigendian=order == '>',
        point_step=layout.itemsize, row_step=layout.itemsize * len(events),
        data=array.array('B', points.tobytes()))


@given(order=st.sampled_from('<>'), names=st.permutations(list(EVENT.names or ())),
       pad=st.integers(0, 9))
def test_any_layout_and_byte_order_is_read(order: str, names: list[str], pad: int) -> None:
    """Fields are found by name, wherever they lie."""
    events = some_events(20)
    assert messages.events_from_cloud(
        foreign(events, order, names, pad)).tobytes() == events.tobytes()


def test_rows_with_padding_are_read_or_refused() -> None:
    """A cloud of several rows is never misread."""
    events = some_events(6)
    cloud = messages.cloud_from_events(events, STAMP)
    row = cloud.point_step * 3
    data = bytes(cloud.data)
    cloud.height, cloud.width, cloud.row_step = 2, 3, row + 16
    cloud.data = array.array('B', data[:row] + bytes(16) + data[row:] + bytes(16))
    try:
        found = messages.events_from_cloud(cloud)
    except ValueError as error:
        assert 'row' in str(error)
    else:
        assert found.tobytes() == events.tobytes()


@pytest.mark.parametrize('name', EVENT.names)
def test_a_missing_or_wrong_field_is_named(name: str) -> None:
    """No field, another type, several values, or beyond the point: ValueError names it."""
    cloud = messages.cloud_from_events(some_events(5), STAMP)
    fields = {field.name: (field.offset, field.datatype, field.count) for field in cloud.fields}
    offset, datatype, _ = fields[name]
    for wrong in (None, (offset, PointField.FLOAT32, 1), (offset, datatype, 2),
                  (cloud.point_step - 3, datatype, 1), (2**32 - 1, datatype, 1)):
        table = {**fields, name: wrong}
        cloud.fields = [PointField(name=n, offset=f[0], datatype=f[1], count=f[2])
                        for n, f in table.items() if f is not None]
        with pytest.raises(ValueError, match=f"field '{name}'"):
            messages.events_from_cloud(cloud)


def test_too_few_bytes_are_refused() -> None:
    """The error of a cloud that ends early has its number of bytes."""
    cloud = messages.cloud_from_events(some_events(5), STAMP)
    cloud.data = cloud.data[:-1]
    with pytest.raises(ValueError, match=f'{5 * cloud.point_step - 1} bytes for 5 points'):
        messages.events_from_cloud(cloud)


@pytest.mark.parametrize('name, value', [
    ('kind', 5), ('phase', math.nan), ('phase', -1e-9), ('phase', 6.3), ('displacement', 0.1),
    ('displacement', -1.1), ('velocity', math.nan), ('velocity', math.inf),
    ('velocity_after', -math.inf), ('alpha', -1.0), ('beta', math.nan), ('gamma', math.inf),
    ('restitution', 1.1)])
def test_a_record_that_no_simulator_writes_is_refused(name: str, value: float) -> None:
    """The message gives number, field and value."""
    events = some_events(5)
    events[name][3] = value
    cloud = messages.cloud_from_events(events, STAMP)
    with pytest.raises(ValueError, match=f'event 3 .* {name} = '):
        messages.events_from_cloud(cloud)


def test_arrays_of_joint_states_that_do_not_apply_are_empty() -> None:
    """By the conventions of ROS they claim nothing."""
    message = messages.joint_state({'a': (1, np.float32(1.5)), 'b': (2.0, 3)}, STAMP, 'frame')
    back = deserialize_message(serialize_message(message), JointState)
    assert back.name == ['a', 'b']
    assert list(back.position) == [1.0, 2.0]
    assert list(back.velocity) == [1.5, 3.0]
    assert list(back.effort) == []
    assert (back.header.stamp, back.header.frame_id) == (STAMP, 'frame')
    named = messages.named_values({'lambda_1': np.float64(0.1), 'lambda_2': math.nan}, STAMP)
    assert named.position[0] == 0.1 and math.isnan(named.position[1])
    assert (list(named.velocity), list(named.effort)) == ([], [])


@given(st.integers(0, 2**31 * 10**9 - 1))
def test_stamps_keep_every_nanosecond(nanoseconds: int) -> None:
    """From an integer and back."""
    stamp = messages.stamp_from_nanoseconds(nanoseconds)
    assert rclpy.time.Time.from_msg(stamp).nanoseconds == nanoseconds
    assert 0 <= stamp.nanosec < 10**9


@pytest.mark.parametrize('seconds', [2**31, 2**31 + 5, 2**33, 10**12])
def test_stamps_beyond_2038_do_not_end_a_node(seconds: int) -> None:
    """Simulated time runs past 32 bits in minutes at full speed: still a message."""
    stamp = messages.stamp_from_nanoseconds(seconds * 10**9 + 7)
    wired = deserialize_message(serialize_message(stamp), Time)
    assert wired == stamp
    assert stamp.sec >= 0


@given(cycle=st.integers(0, 10**6), phase=st.floats(0.0, 2 * math.pi, exclude_max=True),
       omega=st.sampled_from([2 * math.pi, 1.0, 100.0, 1e-3]))
def test_drive_time_is_tau_over_omega(cycle: int, phase: float, omega: float) -> None:
    """In nanoseconds, to rounding; with omega = 2 pi a period is a second, exactly."""
    found = messages.drive_time_nanoseconds(cycle, phase, omega)
    exact = (cycle * 2 * math.pi + phase) / omega * 1e9
    assert found == pytest.approx(exact, rel=1e-15, abs=1.5)
    assert found <= messages.drive_time_nanoseconds(cycle + 1, 0.0, omega) + 1
    assert messages.drive_time_nanoseconds(cycle, 0.0, 2 * math.pi) == cycle * 10**9


def test_diagnostics_keep_the_digits() -> None:
    """Levels are those of the standard; floats come back to the bit."""
    for level, expected in (('ok', DiagnosticStatus.OK), ('warn', DiagnosticStatus.WARN),
                            ('error', DiagnosticStatus.ERROR)):
        message = messages.diagnostic_array(
            'node: part', 'hardware', level, 'text', {'x': 0.1 + 0.2, 'n': 3, 'word': 'yes'},
            STAMP)
        status = message.status[0]
        assert status.level == expected
        assert {pair.key: pair.value for pair in status.values} == {
            'x': repr(0.1 + 0.2), 'n': '3', 'word': 'yes'}
        assert float(status.values[0].value) == 0.1 + 0.2
        assert (status.name, status.hardware_id, status.message) == (
            'node: part', 'hardware', 'text')


FIELDS = st.tuples(
    st.sampled_from([*(EVENT.names or ()), 'x', 'Kind', '']),
    st.one_of(st.integers(0, 128), st.integers(0, 2**32 - 1)), st.integers(0, 255),
    st.one_of(st.just(1), st.integers(0, 2**32 - 1)))
HOSTILE = st.fixed_dictionaries({}, optional={
    'height': st.integers(0, 2**32 - 1), 'width': st.integers(0, 2**32 - 1),
    'point_step': st.one_of(st.integers(0, 200), st.integers(0, 2**32 - 1)),
    'row_step': st.integers(0, 2**32 - 1), 'is_bigendian': st.booleans(),
    'data': st.one_of(st.binary(max_size=600), st.integers(0, 480))})


@given(attributes=HOSTILE, changed=st.dictionaries(st.integers(0, 14), FIELDS, max_size=3),
       patch=st.dictionaries(st.integers(0, 479), st.integers(0, 255), max_size=4))
def test_a_hostile_cloud_is_refused_or_read_as_described(
        attributes: dict[str, object], changed: dict[int, tuple[str, int, int, int]],
        patch: dict[int, int]) -> None:
    """One line of ValueError, or the very values that stand in the bytes, all of them possible."""
    cloud = messages.cloud_from_events(some_events(5), STAMP)
    data = bytearray(cloud.data)
    for place, byte in patch.items():
        data[place] = byte
    cloud.data = array.array('B', data)
    fields = [(f.name, f.offset, f.datatype, f.count) for f in cloud.fields]
    for place, field in changed.items():
        fields[place % len(fields)] = field
    cloud.fields = [PointField(name=n, offset=o, datatype=d, count=c) for n, o, d, c in fields]
    for name, value in attributes.items():
        if name == 'data':
            value = array.array('B', value if isinstance(value, bytes) else data[:value])
        setattr(cloud, name, value)
    try:
        events = messages.events_from_cloud(cloud)
    except ValueError as error:
        assert str(error) and '\n' not in str(error)
        return
    order = '>' if cloud.is_bigendian else '<'
    for name in EVENT.names or ():
        (offset, datatype, count), = [place for field, *place in fields if field == name]
        assert count == 1 and datatype == (6 if EVENT[name].itemsize == 4 else 8)
        code = order + ('I' if datatype == 6 else 'd')
        for number, value in enumerate(events[name].tolist()):
            start = number * cloud.point_step + offset
            assert struct.unpack_from(code, cloud.data, start)[0] == value
    assert len(events) == cloud.width * cloud.height
    assert (events['kind'] <= 4).all() and np.isfinite(events['velocity']).all()
    assert ((events['phase'] >= 0.0) & (events['phase'] <= 2.0 * np.pi)).all()
