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

"""The table of all ROS parameters, and how a node declares and guards them."""

from collections.abc import Callable, Mapping, Sequence
import dataclasses
import difflib
import functools
import math
import types
from typing import Final, TypeAlias

from rcl_interfaces import msg
from rclpy.node import Node
from rclpy.parameter import Parameter

from .core import model
from .core.defaults import QUANTITIES
from .core.flight import simulation
from .core.flight.law import Acts
from .core.flight.noise import Noise
from .core.words import shown

Value: TypeAlias = bool | int | float | str


@dataclasses.dataclass(frozen=True)
class Specification:
    """One parameter: its default also gives its type."""

    name: str
    default: Value
    description: str
    unit: str = '1'
    low: float | None = None
    high: float | None = None
    read_only: bool = True
    choices: tuple[str, ...] = ()

    def descriptor(self) -> msg.ParameterDescriptor:
        descriptor = msg.ParameterDescriptor(
            description=self.cells()[-1], read_only=self.read_only)
        if self.low is not None and self.high is not None:
            if isinstance(self.default, float):
                descriptor.floating_point_range = [
                    msg.FloatingPointRange(from_value=float(self.low), to_value=float(self.high))]
            else:
                descriptor.integer_range = [
                    msg.IntegerRange(from_value=int(self.low), to_value=int(self.high))]
        return descriptor

    def cells(self) -> tuple[str, str, str, str, str]:
        """Return a row of a table: name, default, range, whether it is live, and meaning."""
        default = self.default
        span = (f'{self.low:g} to {self.high:g}'
                if self.low is not None and self.high is not None else '')
        return (self.name, f'{default:g}' if isinstance(default, float) else str(default).lower(),
                span, '' if self.read_only else 'yes',
                f'{self.description} [{self.unit}]' if self.unit else self.description)

    def check(self, value: object) -> Value:
        """Return a value of the right type and range; ValueError names a wrong one."""
        wanted = type(self.default)
        if wanted is float and isinstance(value, int) and not isinstance(value, bool):
            value = float(value)
        if wanted is str and type(value) is int:
            # In YAML 2 is a number, be it the name of something.
            value = str(value)
        if not isinstance(value, wanted) or (wanted is int and isinstance(value, bool)):
            raise ValueError(f'{self.name} = {shown(value)} is not of type {_TYPE_NAMES[wanted]}')
        if isinstance(value, float) and math.isnan(value):
            raise ValueError(f'{self.name} = {value!r} is not a number')
        if self.choices and value not in self.choices:
            raise ValueError(f'{self.name} = {shown(value)} is not one of '
                             f'{", ".join(self.choices)}')
        if isinstance(value, (int, float)) and self.low is not None and self.high is not None and (
                not self.low <= value <= self.high):
            raise ValueError(f'{self.name} = {value!r} is outside [{self.low:g}, {self.high:g}]')
        return value


_TYPE_NAMES: Final[dict[type, str]] = {
    bool: 'bool', int: 'integer', float: 'double', str: 'string'}
# Parameters that rclpy itself declares or reads.
_OF_ROS: Final = ('use_sim_time', 'qos_overrides.', 'start_type_description_service')
BELOW_TWO_PI: Final = math.nextafter(2.0 * math.pi, 0.0)
_fixed = Specification
_live = functools.partial(Specification, read_only=False)
_FRAME: Final = _fixed('frame', '', 'frame of the section; empty = section in the namespace', '')

_QUANTITIES: Final = tuple(
    _fixed(name, 0.0, f'{words}; if given, it replaces that of gears', unit, -1e9, 1e9)
    for name, (words, unit) in QUANTITIES.items() if name != 'restitution')

# With one of these the frequency of the drive changes while the simulator runs.
SPEEDS: Final = ('frequency_hz', 'speed_rpm')
SIMULATOR: Final = (
    _live('alpha', 0.48, 'amplitude of the drive', low=0.0, high=model.ALPHA_MAXIMUM),
    _live('beta', 0.1, 'damping', low=0.0, high=model.BETA_MAXIMUM),
    _live('gamma', 0.1, 'constant load', low=-model.GAMMA_MAXIMUM, high=model.GAMMA_MAXIMUM),
    _live('restitution', 0.9, 'coefficient of restitution', low=0.0, high=1.0),
    _live('noise', 0.0, 'standard deviation of what noise_kind says', low=0.0,
          high=simulation.NOISE_MAXIMUM),
    _live('noise_kind', 'gaussian', 'what is random: a kick at every impact, gaussian or uniform, '
          'or (jitter) alpha, drawn anew at the end of every drive period', '',
          choices=tuple(kind.name.lower() for kind in Noise)),
    _live('control', '', 'law that holds an orbit, as the control node writes it; it ends, and '
          'becomes empty, when alpha, beta, gamma or restitution changes; empty = none', ''),
    _live('rate', 100.0, 'speed; 0 = as fast as the readers keep up', 'drive periods per second',
          0.0, 1e7),
    _live('alpha_target', 0.48, 'target of a ramp of alpha', low=0.0, high=model.ALPHA_MAXIMUM),
    _live('alpha_rate', 0.0, 'change of alpha at the end of every drive period until it reaches '
          'alpha_target; 0 = no ramp; it becomes 0 when the ramp ends or alpha is set', '1 per '
          'drive period', 0.0, 1.0),
    _live('initial_phase', 0.0, 'initial drive phase, also after a reset', 'rad', 0.0,
          BELOW_TWO_PI),
    _live('initial_displacement', 0.0, 'initial displacement, also after a reset', low=-1.0,
          high=0.0),
    _live('initial_velocity', -0.5, 'initial velocity, also after a reset',
          low=-model.VELOCITY_MAXIMUM, high=model.VELOCITY_MAXIMUM),
    _live('seed', 0, 'seed of the noise, used at the beginning and at a reset', '', 0,
          simulation.SEED_MAXIMUM),
    _fixed('omega', 2.0 * math.pi, 'drive frequency at the beginning: simulated time is tau/omega',
           'rad/s', 1e-6, 1e9),
    _fixed('tick', 0.02, 'interval at which batches are published', 's', 0.001, 10.0),
    _fixed('display_rate', 30.0, 'joint states per second of wall time', 'Hz', 0.0, 1000.0),
    _fixed('backlash_angle', 0.01, 'backlash, the scale of the joint states', 'rad', 1e-9, 1.0),
    _fixed('publish_clock', False, 'publish the simulated time on /clock, and stamp with it', ''),
    _fixed('gears', '', 'YAML file of a gear pair, which gives alpha, beta, gamma, restitution, '
           'omega and backlash_angle their defaults', ''),
    *(dataclasses.replace(each, read_only=False, description=f'{each.description}; beta and gamma '
                          'follow a change, where the gear pair has it')
      if each.name in SPEEDS else each for each in _QUANTITIES),
    _FRAME,
    _fixed('scene', '', 'scene to be played from the beginning; its first step replaces the '
           'defaults', ''),
    _fixed('wait_for_readers', 0, 'begin when impacts has this number of subscriptions',
           'subscriptions', 0, 1000),
    _fixed('wait_at_most', 600.0, 'begin after this time without those that are missing; 0 = '
           'never', 's', 0.0, 1e6),
)
LYAPUNOV: Final = (
    _fixed('publish_rate', 10.0, 'estimates per second of wall time', 'Hz', 0.1, 1000.0),
    _fixed('window', 1000, 'impacts in the finite-time exponent', 'impacts', 1, 1000000),
)
TRANSIENTS: Final = (
    _fixed('tolerance', 1e-3, 'largest distance from an orbit in phase and velocity', low=1e-9,
           high=0.1),
    _fixed('display_rate', 30.0, 'messages on last_impact per second of wall time', 'Hz', 0.0,
           1000.0),
    _fixed('rattle_rate', 2.0, 'messages on rattle per second of wall time', 'Hz', 0.0, 1000.0),
    _fixed('rattle_above', 0.0, 'approach speed from which impacts count for the rates and speeds '
           'on rattle', 'm/s; without a gear pair 1', 0.0, 1e4),
    _fixed('gears', '', 'YAML file of a gear pair, in whose SI units rattle is', ''),
    *_QUANTITIES,
)
BASIN: Final = (
    _fixed('size', 800, 'edge of the finest picture; the first has 50, each next one twice as '
           'many', 'cells', 50, 4000),
    _fixed('plane', 'impact', 'plane of the initial conditions: impact (just before one, so that '
           'every impact lies in its own basin), section (just after one), displacement (all at '
           'the same) or strobe (all at the same drive phase)', '',
           choices=('section', 'impact', 'displacement', 'strobe')),
    _fixed('displacement', 0.0, 'displacement of all initial conditions where plane = '
           'displacement', low=-1.0, high=0.0),
    _fixed('phase', 0.0, 'drive phase of all initial conditions where plane = strobe', 'rad', 0.0,
           2.0 * math.pi),
    _fixed('velocity_limit', 0.0, 'highest velocity of the plane, in both directions; 0 = chosen '
           'to suit the attractors', low=0.0, high=model.VELOCITY_MAXIMUM),
    _fixed('skeleton', True, 'whether to compute the skeleton after the finest picture', ''),
    _fixed('cap', 20000, 'impacts after which an initial condition counts as unsettled', 'impacts',
           100, 10000000),
    _fixed('threads', 2, 'number of computing threads', 'threads', 1, 256),
    _fixed('niceness', 10, 'niceness of the first picture: 0 = as important as other processes, '
           '19 = least, as for finer pictures', '', 0, 19),
    _FRAME,
)
CONTROL: Final = (
    _live('orbit', '', 'unstable orbit to hold: its key, a letter, its number of impacts, or <N '
          'for the longest of fewer than N impacts; empty = none', ''),
    _live('acts', 'drive', 'what the law changes at impacts: alpha until the next one, by the '
          'distance from the orbit (drive) or by the velocity a period ago (delayed), or the '
          'velocity after them (pulses)', '', choices=tuple(each.name.lower() for each in Acts)),
    _live('limit', 0.002, 'largest change of alpha, or of the velocity', low=1e-9, high=10.0),
    _fixed('publish_rate', 10.0, 'messages on control per second of wall time', 'Hz', 0.1, 1000.0),
    _fixed('simulator', 'simulator', 'name of the node to steer, in any namespace', ''),
)
RECORDER: Final = (
    _fixed('output', '', 'bag directory to create; empty = rosbag2_DATE-TIME here', ''),
    _fixed('compression', 'zstd', 'compression of the chunks: zstd, lz4 or none', '',
           choices=('zstd', 'lz4', 'none')),
    _fixed('max_bag_size', 0, 'size at which another file of the bag begins; 0 = never', 'bytes',
           0, 2**53),
    _fixed('max_bag_duration', 3600, 'duration at which another file begins; the index of a file '
           'is in memory until then; 0 = never', 's', 0, 10**9),
)
REPLAY: Final = (
    _fixed('bag', '', 'bag directory or .mcap file', ''),
    _fixed('speed', 1.0, 'speed in units of the recorded one; 0 = as fast as the readers keep up',
           '1', 0.0, 1e6),
    _fixed('start', 0.0, 'time after the first message at which to begin', 's', 0.0, 1e12),
    _fixed('end', 0.0, 'time after the first message at which to stop; 0 = at the end', 's', 0.0,
           1e12),
    _fixed('loop', False, 'begin again at the end', ''),
    _fixed('clock', False, 'publish the recorded time on /clock', ''),
    _fixed('topics', '', 'names of topics, separated by blanks; empty = all but /diagnostics and '
           '/parameter_events', ''),
    _fixed('wait_for_readers', 0, 'begin when a topic has this number of subscriptions; 0 = when '
           'the number has not changed for 1 s', 'subscriptions', 0, 1000),
)
VIEWER: Final = (
    _fixed('mode', 'auto', 'native, web (on 127.0.0.1), none, or auto: native where there is a '
           'display, else web, or none beside a file', '',
           choices=('auto', 'native', 'web', 'none')),
    _fixed('save', '', 'file to write as well (.rrd); empty = none', ''),
    _fixed('web_port', 9090, 'port of the web viewer', '', 1024, 65535),
    _fixed('colour', 'age', 'what colours the section: age, alpha, or attractor (the one visited '
           'last)', '', choices=('age', 'alpha', 'attractor')),
    _fixed('gears', '', 'YAML file of a gear pair, in whose SI units the state is, too', ''),
    *_QUANTITIES,
)
TELEOP: Final = (
    _fixed('simulator', 'simulator', 'name of the node to steer, in any namespace', ''),
    _fixed('coarse', 0.01, 'step of a parameter by an arrow key', low=1e-12, high=10.0),
    _fixed('fine', 0.0005, 'step of a parameter by an arrow key with shift', low=1e-12, high=10.0),
    _fixed('ramp_rate', 1e-5, 'change of alpha in a ramp where none is typed', '1 per drive '
           'period', 1e-12, 1.0),
)
TABLES: Final[Mapping[str, Sequence[Specification]]] = {
    'simulator': SIMULATOR, 'lyapunov': LYAPUNOV, 'transients': TRANSIENTS, 'basin': BASIN,
    'control': CONTROL, 'recorder': RECORDER, 'replay': REPLAY, 'teleop': TELEOP, 'viewer': VIEWER}


def given_to(node: Node) -> dict[str, Value]:
    """Return the parameters of a node whose overrides are declared."""
    return {name: node.get_parameter(name).value for name in node.get_parameters_by_prefix('')}


def declare(node: Node, table: Sequence[Specification],
            defaults: Mapping[str, Value] = types.MappingProxyType({})) -> dict[str, Value]:
    """Declare a table on a node whose overrides are; ValueError names a bad one."""
    names = [specification.name for specification in table]
    given = given_to(node)
    for name in given:
        if name not in names and not name.startswith(_OF_ROS):
            # ROS ignores it: a section /** has the parameters of other nodes, too.
            node.undeclare_parameter(name)
            if not any(name == each.name for others in TABLES.values() for each in others):
                close = difflib.get_close_matches(name, names, 1)
                hint = f'did you mean {close[0]!r}?' if close else f'known are {", ".join(names)}'
                node.get_logger().warning(f'unknown parameter {shown(name)} is ignored; {hint}')
    values = {}
    for specification in table:
        name = specification.name
        if name in given:
            node.undeclare_parameter(name)
        values[name] = specification.check(given.get(name, defaults.get(
            name, specification.default)))
        node.declare_parameter(
            name, values[name], specification.descriptor(), ignore_override=True)
    return values


def guard(node: Node, table: Sequence[Specification],
          validate: Callable[[dict[str, Value]], None],
          apply: Callable[[dict[str, Value]], None]) -> None:
    """Let the parameters of a table be set live, all or none, or refuse them with a reason."""
    specifications = {specification.name: specification for specification in table}

    def known(parameters: list[Parameter]) -> dict[str, Value]:
        return {each.name: each.value for each in parameters if each.name in specifications}

    def promote(parameters: list[Parameter]) -> list[Parameter]:
        # To a double or a string, where one is wanted.
        return [Parameter(each.name, value=type(specifications[each.name].default)(each.value))
                if each.type_ == Parameter.Type.INTEGER and each.name in specifications else each
                for each in parameters]

    def accept(parameters: list[Parameter]) -> msg.SetParametersResult:
        # An exception would end the node: it becomes the answer instead.
        try:
            validate({name: specifications[name].check(value)
                      for name, value in known(parameters).items()})
        except Exception as error:
            return msg.SetParametersResult(successful=False, reason=str(error))
        return msg.SetParametersResult(successful=True)

    node.add_pre_set_parameters_callback(promote)
    node.add_on_set_parameters_callback(accept)
    node.add_post_set_parameters_callback(lambda parameters: apply(known(parameters)))
