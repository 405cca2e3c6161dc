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

"""Another vendor's DDS reads the stream: Eclipse Cyclone DDS, without any ROS."""

from dataclasses import dataclass
import json
import os
import subprocess
import sys

import numpy as np
import pytest

from gear_rattle_ros.core.flight.simulation import Simulation
from gear_rattle_ros.core.model import EVENT, Parameters, State

pytest.importorskip('cyclonedds', reason='Cyclone DDS has no wheel for this Python')

# Loopback only, as our own traffic: Fast DDS is found at 127.0.0.1 by unicast.
CONFIGURATION = """
<CycloneDDS><Domain><General>
  <Interfaces><NetworkInterface name="lo"/></Interfaces>
  <AllowMulticast>false</AllowMulticast>
</General><Discovery>
  <ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>60</MaxAutoParticipantIndex>
  <Peers><Peer address="127.0.0.1"/></Peers>
</Discovery></Domain></CycloneDDS>
"""
WANTED = 2000


def read_with_cyclone() -> None:
    """Subscribe to rt/impacts and print what came, as JSON; runs in a process of its own."""
    from cyclonedds.core import Policy, Qos
    from cyclonedds.domain import DomainParticipant
    from cyclonedds.idl import IdlStruct
    from cyclonedds.idl.types import int32, sequence, uint8, uint32
    from cyclonedds.sub import DataReader
    from cyclonedds.topic import Topic
    from cyclonedds.util import duration

    @dataclass
    class Time(IdlStruct, typename='builtin_interfaces.msg.dds_.Time_'):
        sec: int32
        nanosec: uint32

    @dataclass
    class Header(IdlStruct, typename='std_msgs.msg.dds_.Header_'):
        stamp: Time
        frame_id: str

    @dataclass
    class PointField(IdlStruct, typename='sensor_msgs.msg.dds_.PointField_'):
        name: str
        offset: uint32
        datatype: uint8
        count: uint32

    @dataclass
    class PointCloud2(IdlStruct, typename='sensor_msgs.msg.dds_.PointCloud2_'):
        header: Header
        height: uint32
        width: uint32
        fields: sequence[PointField]
        is_bigendian: bool
        point_step: uint32
        row_step: uint32
        data: sequence[uint8]
        is_dense: bool

    participant = DomainParticipant(int(os.environ['ROS_DOMAIN_ID']))
    reader = DataReader(
        participant, Topic(participant, 'rt/impacts', PointCloud2),
        Qos(Policy.Reliability.Reliable(duration(seconds=1)), Policy.History.KeepAll))
    print('ready', flush=True)
    points, fields = 0, {}
    data = b''
    while points < WANTED:
        for sample in reader.take_iter(timeout=duration(seconds=20)):
            fields = {field.name: (field.offset, field.datatype) for field in sample.fields}
            data += bytes(sample.data)
            points += sample.width
            if points >= WANTED:
                break
    print(json.dumps({'fields': fields, 'step': sample.point_step,
                      'frame': sample.header.frame_id, 'data': data.hex()}), flush=True)


def test_cyclone_dds_receives_the_stream(start, domain, tmp_path):
    """The fields and the data are those the core computes, bit for bit."""
    child = subprocess.Popen(
        [sys.executable, __file__], stdout=subprocess.PIPE, text=True,
        env={**os.environ, 'CYCLONEDDS_URI': CONFIGURATION})
    try:
        assert child.stdout.readline() == 'ready\n'
        start('simulator', '--ros-args', '-p', 'wait_for_readers:=1', '-p', 'rate:=500.0')
        output = json.loads(child.communicate(timeout=60)[0])
    finally:
        child.kill()
    formats = {6: np.uint32, 7: np.float32, 8: np.float64}
    names = [name for name in output['fields'] if name in EVENT.names]
    layout = np.dtype({
        'names': names,
        'formats': [formats[output['fields'][name][1]] for name in names],
        'offsets': [output['fields'][name][0] for name in names],
        'itemsize': output['step'],
    })
    found = np.frombuffer(bytes.fromhex(output['data']), layout)
    # It may find the simulator later than the simulator finds it, and misses what was before.
    stream = Simulation(Parameters(), State(velocity=-0.5)).advance(10**6, 0.0, len(found) + 1000)
    first = next(i for i, event in enumerate(stream)
                 if (event['kind'], event['index']) == (found['kind'][0], found['index'][0]))
    wanted = stream[first:first + len(found)]
    assert output['frame'] == 'section'
    assert set(names) == set(EVENT.names)
    for name in EVENT.names:
        np.testing.assert_array_equal(found[name], wanted[name])


if __name__ == '__main__':
    read_with_cyclone()
