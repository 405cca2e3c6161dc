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

"""Named quality-of-service profiles, and which of them parameters may override."""

from collections.abc import Mapping, Sequence
import enum
from typing import Any, Final

from rclpy.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    QoSPolicyKind,
    QoSProfile,
    ReliabilityPolicy,
)
from rclpy.qos_overriding_options import QoSOverridingOptions

# Batches that a publisher keeps for readers that have not acknowledged them.
STREAM_DEPTH = 1000


def profile(depth: int, *, is_reliable: bool = True, is_latched: bool = False) -> QoSProfile:
    """Return a profile that keeps the last `depth` messages, or all of them where that is 0."""
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST if depth else HistoryPolicy.KEEP_ALL,
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if is_reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if is_latched else DurabilityPolicy.VOLATILE)


# Everything that must not be lost.
STREAM = profile(STREAM_DEPTH)
# How the nodes of the package read it: a full reader refuses and so holds the writer up, where
# one that keeps the last would drop the oldest batch in silence.
STREAM_INPUT = profile(0)
# The newest batch only: it is acknowledged at once, whether or not it is read.
NEWEST = profile(1)
# The present state of something, also for readers that join later.
LATCHED = profile(1, is_latched=True)
CLOCK = profile(1, is_reliable=False)

OVERRIDING: Final = QoSOverridingOptions((
    QoSPolicyKind.HISTORY, QoSPolicyKind.DEPTH, QoSPolicyKind.RELIABILITY,
    QoSPolicyKind.DURABILITY))
_CHOICES: Final[Mapping[str, type[enum.Enum]]] = {
    'history': HistoryPolicy, 'reliability': ReliabilityPolicy, 'durability': DurabilityPolicy}
_BASIN: Final = ('basin', 'attractors', 'basin_state', 'skeleton')
# The topics of each node. Not here are those of ROS itself, and impacts in the basin node, which
# is for the newest batch only. Those of replay are in its bag.
OVERRIDABLE: Final[Mapping[str, Mapping[str, Sequence[str]]]] = {
    'simulator': {'publisher': ('impacts', 'joint_states', '/clock')},
    'lyapunov': {'publisher': ('lyapunov',), 'subscription': ('impacts',)},
    'transients': {'publisher': ('transient', 'last_impact', 'rattle', 'hops'),
                   'subscription': ('impacts',)},
    'basin': {'publisher': (*_BASIN, 'smallest_kick')},
    'control': {'publisher': ('control',), 'subscription': ('impacts',)},
    'recorder': {'subscription': ('impacts', 'joint_states', 'lyapunov', 'transient', 'control',
                                  'last_impact', 'rattle', 'hops', *_BASIN, 'smallest_kick')},
    'teleop': {},
    'viewer': {'subscription': ('impacts', 'lyapunov', 'transient', *_BASIN)},
}


def check_overrides(given: Mapping[str, Any], topics: Mapping[str, Sequence[str]]) -> None:
    """Raise ValueError where a parameter qos_overrides.* would have no effect, or a wrong one."""
    for name, value in given.items():
        prefix, _, rest = name.partition('.')
        if prefix != 'qos_overrides':
            continue
        topic, place, policy = (['', '', *rest.rsplit('.', 2)])[-3:]
        if topic not in topics.get(place, ()) or policy not in (*_CHOICES, 'depth'):
            known = ', '.join(f'{topic}.{place}' for place, names in topics.items()
                              for topic in names)
            raise ValueError(f'{name} cannot be overridden in this node; ' + (
                f'overridable are history, depth, reliability and durability of {known}'
                if known else 'nothing is overridable'))
        allowed = [each.name.lower() for each in _CHOICES.get(policy, ())
                   if each.name != 'UNKNOWN']
        if allowed and value not in allowed:
            raise ValueError(f'{name} = {value!r} is not one of {", ".join(allowed)}')
        if not allowed and (type(value) is not int or not 1 <= value < 2**31):
            raise ValueError(f'{name} = {value!r} is not a number of messages from 1 on')
