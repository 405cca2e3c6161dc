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

"""Bags made without nodes, for the tests of reading and replay."""

from collections.abc import Sequence
from pathlib import Path
import sys

from builtin_interfaces.msg import Time
import numpy as np
from rclpy.serialization import serialize_message
from rosbags.typesys import get_typestore, Stores

from gear_rattle_ros.bags import BagWriter, message_definition, Topic
from gear_rattle_ros.core.flight.simulation import Simulation
from gear_rattle_ros.core.model import EventArray, Parameters, State
from gear_rattle_ros.messages import cloud_from_events, named_values

START = 1_700_000_000_000_000_000
STEP = 10_000_000
TYPES = get_typestore(Stores.ROS2_JAZZY)


def profile(durability: str = 'volatile') -> dict[str, object]:
    """Return a quality of service in rosbag2's words, with times that never end."""
    never = {'sec': 9223372036, 'nsec': 854775807}
    return {
        'history': 'unknown', 'depth': 0, 'reliability': 'reliable', 'durability': durability,
        'deadline': never, 'lifespan': never, 'liveliness': 'automatic',
        'liveliness_lease_duration': never, 'avoid_ros_namespace_conventions': False,
    }


def topic(name: str, type_name: str, durability: str = 'volatile') -> Topic:
    """Return a topic with the definition that ROS has installed here."""
    return Topic(name, type_name,
                 message_definition(type_name, lambda package: f'{sys.prefix}/share/{package}'),
                 TYPES.hash_rihs01(type_name), (profile(durability),))


def story(count: int = 5000) -> EventArray:
    """Return chaotic events, one retune among them."""
    simulation = Simulation(Parameters(0.57), State(0, 0.0, 0.0, -0.5), noise=1e-3)
    first = simulation.advance(10**6, 0.0, count // 2)
    return np.concatenate([first, simulation.retune(Parameters(1.244)),
                           simulation.advance(10**6, 0.0, count - count // 2)])


def padded(data: bytes) -> bytes:
    """Return a serialized message of the length that DDS delivers, a multiple of four."""
    return data + bytes(-len(data) % 4)


def batches(events: EventArray, size: int = 100) -> list[bytes]:
    """Return the events as serialized clouds."""
    return [
        padded(serialize_message(
            cloud_from_events(events[start:start + size], Time(sec=start))))
        for start in range(0, len(events), size)
    ]


def states(count: int) -> list[bytes]:
    """Return serialized joint states."""
    return [padded(serialize_message(named_values({'lambda_1': number / 8}, Time(sec=number))))
            for number in range(count)]


def make_bag(path: Path, clouds: Sequence[bytes], others: Sequence[bytes] = (),
             flush_every: int = 10, compression: str = 'zstd', **splits: int) -> None:
    """Write a bag: a cloud every STEP, and a state half a step after each while there are any."""
    writer = BagWriter(path, compression, **splits)
    impacts = writer.add_topic(topic('/impacts', 'sensor_msgs/msg/PointCloud2'))
    exponents = writer.add_topic(topic('/lyapunov', 'sensor_msgs/msg/JointState'))
    for number, cloud in enumerate(clouds):
        time = START + number * STEP
        if number < len(others):
            # Written before what it follows: readers put it in order.
            writer.write(exponents, time + STEP // 2, time, number, others[number])
        writer.write(impacts, time, time - 1000, number, cloud)
        if number % flush_every == flush_every - 1:
            writer.flush()
    writer.close()
