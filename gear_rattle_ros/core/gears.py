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

"""A gear pair in SI units: its dimensionless parameters, its scales, and what looks wrong."""

from collections.abc import Mapping
import dataclasses
import math
from typing import Any, Final, NamedTuple

from .defaults import QUANTITIES
from .model import Parameters, require_finite

POSITIVE: Final = ('inertia_kg_m2', 'driver_radius_m', 'driven_radius_m', 'backlash_m',
                   'frequency_hz', 'order', 'speed_rpm')
# Each is given in one of two ways.
DRIVE: Final = (('drive_rad',), ('drive_m',))
FREQUENCY: Final = (('frequency_hz',), ('order', 'speed_rpm'))
# Density of steel [kg/m^3].
STEEL: Final = 7850.0


class Scales(NamedTuple):
    """What 1 is in SI: an SI value is the dimensionless one times this."""

    time_s: float  #: Of tau, a radian of the drive phase: 1/omega.
    displacement_m: float  #: Of s, along the pitch circle: the backlash.
    velocity_m_per_s: float  #: Of ds/dtau, along the pitch circle.
    impulse_n_s: float  #: Of a change of velocity at an impact; the mass is inertia/radius^2.
    energy_j: float  #: Of velocity^2; kinetic energy is half of it.
    force_n: float  #: Of an acceleration; that of gamma is torque/radius.


@dataclasses.dataclass(frozen=True, kw_only=True)
class Gears:
    """
    A gear pair in SI units.

    The drive is given as an angle or as an arc, its frequency in Hz or as an order and a speed.
    ValueError names a quantity that is missing, given twice or out of range, and the remedy.
    """

    inertia_kg_m2: float  #: Moment of inertia m of the driven gear [kg m^2].
    driver_radius_m: float  #: Pitch radius R_e of the driver [m].
    driven_radius_m: float  #: Pitch radius R of the driven gear [m].
    backlash_m: float  #: Backlash nu along the pitch circle [m].
    drag_n_m_s_per_rad: float  #: Linear drag d of the driven gear [N m s/rad].
    #: Constant load torque T of the driven gear [N m]; positive presses towards the upper wall.
    torque_n_m: float
    drive_rad: float | None = None  #: Amplitude A of the driver's angular vibration [rad].
    drive_m: float | None = None  #: The same as an arc of the pitch circle [m].
    frequency_hz: float | None = None  #: Frequency of the vibration [Hz].
    order: float | None = None  #: Its periods per revolution at `speed_rpm` [1].
    speed_rpm: float | None = None  #: Revolutions of that shaft per minute [1/min].
    restitution: float  #: Coefficient of restitution r [1].

    def __post_init__(self) -> None:
        for ways in (DRIVE, FREQUENCY):
            given = [way for way in ways if any(self._has(name) for name in way)]
            if len(given) != 1 or not all(self._has(name) for name in given[0]):
                first, second = (' and '.join(way) for way in ways)
                raise ValueError(f'give either {first} or {second}, not '
                                 + ('both' if len(given) > 1 else 'part of it' if given
                                    else 'neither'))
        for name in QUANTITIES:
            if self._has(name):
                low = -math.inf if name == 'torque_n_m' else 0.0
                high = 1.0 if name == 'restitution' else math.inf
                value = require_finite(name, getattr(self, name), low, high)
                if value == 0.0 and name in POSITIVE:
                    raise ValueError(f'{name} = {value!r} must be positive')
                object.__setattr__(self, name, value)
        try:
            _ = self.parameters
        except ValueError as error:
            name = str(error).split()[0]
            quantity, unit = self.units[name]
            cause = 'the load holds the flanks together, or' if name == 'gamma' else 'probably'
            raise ValueError(f'{error}; it is {quantity} divided by {unit:g}: {cause} a unit is '
                             'wrong') from error

    @classmethod
    def of(cls, values: Mapping[str, Any], **changes: Any) -> 'Gears':
        """Make a gear pair from values by name; a change drops the other way to give the same."""
        for ways in (DRIVE, FREQUENCY):
            for way, other in (ways, ways[::-1]):
                if any(name in changes for name in way):
                    values = {name: value for name, value in values.items() if name not in other}
        values = {**values, **changes}
        for name, value in values.items():
            if name not in QUANTITIES:
                raise ValueError(f'unknown quantity {name!r}; known are {", ".join(QUANTITIES)}')
            if isinstance(value, bool):
                raise ValueError(f'{name} = {value} is not a number')
        for field in dataclasses.fields(cls):
            if field.default is dataclasses.MISSING and values.get(field.name) is None:
                words, unit = QUANTITIES[field.name]
                raise ValueError(f'{field.name} is missing: {words} [{unit}]')
        return cls(**values)

    def _has(self, name: str) -> bool:
        return getattr(self, name) is not None

    @property
    def given(self) -> dict[str, float]:
        """Return the quantities that were given, by name."""
        return {name: getattr(self, name) for name in QUANTITIES if self._has(name)}

    def at(self, **changes: float) -> 'Gears':
        """Return the gear pair with other values; the other way to give the same is dropped."""
        return Gears.of(self.given, **changes)

    @property
    def omega(self) -> float:
        """Return the angular frequency of the drive [rad/s]."""
        hertz = self.frequency_hz
        if hertz is None:
            assert self.order is not None and self.speed_rpm is not None
            hertz = self.order * self.speed_rpm / 60.0
        return 2.0 * math.pi * hertz

    @property
    def units(self) -> dict[str, tuple[str, float]]:
        """Return, for each dimensionless parameter, its quantity and what 1 is of it in SI."""
        length, inertia, omega = self.backlash_m, self.inertia_kg_m2, self.omega
        drive = (('drive_m', length) if self.drive_rad is None else
                 ('drive_rad', length / self.driver_radius_m))
        return {
            'alpha': drive, 'beta': ('drag_n_m_s_per_rad', inertia * omega),
            'gamma': ('torque_n_m', inertia * length * omega**2 / self.driven_radius_m),
            'restitution': ('restitution', 1.0)}

    @property
    def parameters(self) -> Parameters:
        """
        Return the dimensionless parameters.

        ``alpha = A R_e/nu``, ``beta = d/(m omega)``, ``gamma = T R/(m nu omega^2)``: the paper's
        definitions below eq. (3), with the nu that makes gamma dimensionless.
        """
        return Parameters(**{name: getattr(self, quantity) / unit
                             for name, (quantity, unit) in self.units.items()})

    def require(self, parameters: Parameters) -> None:
        """Raise ValueError where the gear pair has other parameters."""
        for name, ours in vars(self.parameters).items():
            theirs = getattr(parameters, name)
            if not math.isclose(ours, theirs, rel_tol=1e-9, abs_tol=1e-12):
                raise ValueError(f'{name} = {theirs:g}, but that of the gear pair is {ours:g}; '
                                 'give its parameters')

    def with_parameters(self, parameters: Parameters) -> 'Gears':
        """Return the gear pair whose drive, drag, torque and restitution give these parameters."""
        return self.at(**{quantity: getattr(parameters, name) * unit
                          for name, (quantity, unit) in self.units.items()})

    @property
    def scales(self) -> Scales:
        """Return what 1 is in SI."""
        omega, length = self.omega, self.backlash_m
        mass, velocity = self.inertia_kg_m2 / self.driven_radius_m**2, self.backlash_m * omega
        return Scales(1.0 / omega, length, velocity, mass * velocity, mass * velocity**2,
                      mass * velocity * omega)

    @property
    def onset_hz(self) -> float:
        """Return the frequency above which a gear at rest is lifted, all else equal [Hz]."""
        arc = self.parameters.alpha * self.backlash_m
        if self.torque_n_m == 0.0 or arc == 0.0:
            return 0.0 if arc else math.inf
        # alpha sqrt(1 + beta^2) = |gamma| is a quadratic equation in omega^2.
        load = abs(self.torque_n_m) * self.driven_radius_m / self.inertia_kg_m2 / arc
        damping = (self.drag_n_m_s_per_rad / self.inertia_kg_m2)**2
        return math.sqrt(2.0 * load / (damping / load + math.hypot(damping / load, 2.0))
                         ) / (2.0 * math.pi)

    def describe(self) -> str:
        """Put its dimensionless parameters and its scales in words."""
        drive = ', '.join(f'{name} 1 is {quantity} {unit:.4g}' for name, (quantity, unit)
                          in self.units.items() if name != quantity)
        scales = ', '.join(f'{name} {value:.4g}' for name, value in self.scales._asdict().items())
        parameters = ', '.join(f'{name} {value:.6g}'
                               for name, value in vars(self.parameters).items())
        return (f'gear pair at {self.omega / (2.0 * math.pi):.6g} Hz: {parameters}; a gear at '
                f'rest is lifted above {self.onset_hz:.6g} Hz\nin SI 1 is {scales}\n{drive}')

    def warnings(self) -> tuple[str, ...]:
        """Return a line for each thing that looks like a wrong unit, or that never rattles."""
        p, arc = self.parameters, self.parameters.alpha * self.backlash_m
        radius = self.driven_radius_m
        width = 2.0 * self.inertia_kg_m2 / (math.pi * STEEL * radius**4)
        speed, lifts = arc * self.omega, p.alpha * math.hypot(1.0, p.beta)
        return tuple(line for is_odd, line in (
            (max(radius, self.driver_radius_m) > 5.0,
             f'the pitch radii are {self.driver_radius_m:g} m and {radius:g} m: are they in '
             'millimetres?'),
            (self.backlash_m > 0.05 * radius,
             f'backlash_m = {self.backlash_m:g} is {self.backlash_m / radius:.2g} of the pitch '
             'radius: is it in millimetres?'),
            (not 1e-3 < width / radius < 50.0,
             f'a steel disc of radius {radius:g} m with inertia_kg_m2 = {self.inertia_kg_m2:g} '
             f'is {width:.2g} m wide: are they in kg m^2 and m?'),
            (self.drive_rad is not None and self.drive_rad > 0.2,
             f'drive_rad = {self.drive_rad} is {math.degrees(self.drive_rad or 0.0):.3g} degrees: '
             'is it in degrees?'),
            (self.drive_m is not None and arc > 0.2 * self.driver_radius_m,
             f'drive_m = {arc:g} is {arc / self.driver_radius_m:.2g} of the pitch radius: is it '
             'in millimetres?'),
            (not 1e-3 < p.alpha < 100.0,
             f'the drive is {p.alpha:.2g} of the backlash: are both in the right units?'),
            (speed > 10.0,
             f'the drive moves the flanks at {speed:.3g} m/s: is the frequency in Hz, not rad/s?'),
            (p.gamma != 0.0 and lifts > 1e3 * abs(p.gamma),
             f'the torque is {abs(p.gamma) / lifts:.1g} of what the drive overcomes: is it in N '
             'm, and the frequency in Hz, not rad/s?'),
            (lifts < abs(p.gamma),
             'a gear at rest stays at rest: the drive never lifts it, as alpha sqrt(1 + beta^2) = '
             f'{lifts:.3g} is less than gamma = {abs(p.gamma):.3g}; above {self.onset_hz:.4g} Hz, '
             f'or below {lifts / abs(p.gamma or 1.0) * abs(self.torque_n_m):.3g} N m, it does'),
        ) if is_odd)
