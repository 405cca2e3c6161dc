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

"""A gear pair in SI units: the paper's definitions, scales, and what is refused or doubted."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from gear_rattle_ros import Gears, Parameters
from gear_rattle_ros.core.defaults import QUANTITIES

PAIR = {
    'inertia_kg_m2': 2e-4, 'driver_radius_m': 0.04, 'driven_radius_m': 0.05, 'backlash_m': 1e-4,
    'drag_n_m_s_per_rad': 4e-3, 'torque_n_m': 0.02, 'drive_rad': 0.003, 'frequency_hz': 40.0,
    'restitution': 0.9}


def test_the_definitions_of_the_paper() -> None:
    """The definitions alpha = A R_e/nu, beta = d/(m omega), gamma = T R/(m nu omega^2)."""
    gears, omega = Gears(**PAIR), 2.0 * math.pi * 40.0
    assert gears.omega == pytest.approx(omega, rel=1e-15)
    assert gears.parameters.alpha == pytest.approx(0.003 * 0.04 / 1e-4, rel=1e-15)
    assert gears.parameters.beta == pytest.approx(4e-3 / (2e-4 * omega), rel=1e-15)
    assert gears.parameters.gamma == pytest.approx(
        0.02 * 0.05 / (2e-4 * 1e-4 * omega**2), rel=1e-14)
    assert gears.parameters.restitution == 0.9


def test_two_ways_to_give_the_same() -> None:
    """An arc is an angle times the radius; an order is periods per revolution."""
    gears = Gears(**PAIR)
    other = gears.at(drive_m=0.003 * 0.04, order=2.0, speed_rpm=1200.0)
    assert other.drive_rad is None and other.frequency_hz is None
    for name, value in vars(gears.parameters).items():
        assert getattr(other.parameters, name) == pytest.approx(value, rel=1e-14)
    assert other.at(speed_rpm=600.0).omega == pytest.approx(gears.omega / 2.0, rel=1e-15)
    assert other.at(drive_rad=0.003, frequency_hz=40.0) == gears
    assert Gears.of(other.given) == other


# Powers of length, mass and time in the unit of each quantity.
DIMENSIONS = {
    'inertia_kg_m2': (2, 1, 0), 'driver_radius_m': (1, 0, 0), 'driven_radius_m': (1, 0, 0),
    'backlash_m': (1, 0, 0), 'drag_n_m_s_per_rad': (2, 1, -1), 'torque_n_m': (2, 1, -2),
    'drive_rad': (0, 0, 0), 'drive_m': (1, 0, 0), 'frequency_hz': (0, 0, -1), 'order': (0, 0, 0),
    'speed_rpm': (0, 0, -1), 'restitution': (0, 0, 0)}
SCALES = {
    'time_s': (0, 0, 1), 'displacement_m': (1, 0, 0), 'velocity_m_per_s': (1, 0, -1),
    'impulse_n_s': (1, 1, -1), 'energy_j': (2, 1, -2), 'force_n': (1, 1, -2)}


@pytest.mark.parametrize('changes', [{}, {'drive_m': 1e-4, 'order': 0.5, 'speed_rpm': 3000.0}])
def test_other_units_of_length_mass_and_time(changes: dict[str, float]) -> None:
    """They change no dimensionless number, and each scale as its unit says."""
    units = (1000.0, 7.0, 60.0)
    plain = Gears(**PAIR).at(**changes)
    scaled = Gears(**{name: value * math.prod(np.power(units, DIMENSIONS[name]))
                      for name, value in plain.given.items()})
    for name, value in vars(plain.parameters).items():
        assert getattr(scaled.parameters, name) == pytest.approx(value, rel=1e-13)
    for name, powers in SCALES.items():
        assert getattr(scaled.scales, name) == pytest.approx(
            getattr(plain.scales, name) * math.prod(np.power(units, powers)), rel=1e-13)


def test_scales_are_those_of_the_equation_of_motion() -> None:
    """Eqs. (1) and (2) in SI, integrated by scipy, give the flight of eq. (4) times the scales."""
    gears = Gears(**PAIR)
    p, scales, g = gears.parameters, gears.scales, gears
    tau, velocity = 1.2, -0.4
    arc = g.drive_rad * g.driver_radius_m
    # S = A R_e sin(omega t) - R phi, so both are known of phi at the beginning.
    phi = arc * math.sin(0.0) / g.driven_radius_m
    rate = (arc * g.omega - velocity * scales.velocity_m_per_s) / g.driven_radius_m
    end = solve_ivp(lambda _, y: [y[1], -(g.drag_n_m_s_per_rad * y[1] + g.torque_n_m)
                                  / g.inertia_kg_m2],
                    (0.0, tau * scales.time_s), [phi, rate], rtol=1e-12, atol=1e-15).y[:, -1]
    t = tau * scales.time_s
    s = arc * math.sin(g.omega * t) - g.driven_radius_m * end[0]
    v = arc * g.omega * math.cos(g.omega * t) - g.driven_radius_m * end[1]
    # The paper's eqs. (4) and (5).
    ratio, decay = p.gamma / p.beta, math.exp(-p.beta * tau)
    bracket = velocity - p.alpha - ratio
    assert s / scales.displacement_m == pytest.approx(
        p.alpha * math.sin(tau) + ratio * tau + (1.0 - decay) / p.beta * bracket, abs=1e-9)
    assert v / scales.velocity_m_per_s == pytest.approx(
        p.alpha * math.cos(tau) + bracket * decay + ratio, abs=1e-9)


def test_mean_force_energy_and_impulse() -> None:
    """The force of gamma is T/R; energy is force times length, impulse is force times time."""
    gears = Gears(**PAIR)
    s = gears.scales
    assert gears.parameters.gamma * s.force_n == pytest.approx(0.02 / 0.05, rel=1e-14)
    assert s.energy_j == pytest.approx(s.force_n * s.displacement_m, rel=1e-14)
    assert s.impulse_n_s == pytest.approx(s.force_n * s.time_s, rel=1e-14)
    assert s.velocity_m_per_s == pytest.approx(s.displacement_m / s.time_s, rel=1e-14)
    # At a wall, m/R^2 v^2/2 is the energy of the driven gear's angular velocity v/R.
    assert s.energy_j == pytest.approx(2e-4 * (s.velocity_m_per_s / 0.05)**2, rel=1e-14)


@pytest.mark.parametrize('changes', [{}, {'drive_m': 1e-4}])
def test_a_gear_pair_for_given_parameters(changes: dict[str, float]) -> None:
    """It has these parameters, and the inertia, radii, backlash and frequency it had."""
    gears, wanted = Gears(**PAIR).at(**changes), Parameters(0.57, 0.1, -0.1, 0.8)
    other = gears.with_parameters(wanted)
    for name, value in vars(wanted).items():
        assert getattr(other.parameters, name) == pytest.approx(value, rel=1e-14)
    assert other.scales == gears.scales and other.given.keys() == gears.given.keys()


@pytest.mark.parametrize('changes', [
    {}, {'torque_n_m': -3.0}, {'drag_n_m_s_per_rad': 0.0}, {'drag_n_m_s_per_rad': 0.2}])
def test_onset_of_rattle(changes: dict[str, float]) -> None:
    """The frequency of onset is where alpha sqrt(1 + beta^2) = |gamma|, found by bisection."""
    gears = Gears(**{**PAIR, **changes})

    def lift(hertz: float) -> float:
        at = gears.at(frequency_hz=hertz)
        # All by hand: the force on the gear in the frame of the driver.
        beta = at.drag_n_m_s_per_rad / (at.inertia_kg_m2 * at.omega)
        load = abs(at.torque_n_m) * at.driven_radius_m / (
            at.inertia_kg_m2 * at.backlash_m * at.omega**2)
        return 1.2 * math.hypot(1.0, beta) - load

    onset = brentq(lift, gears.onset_hz / 1.5, gears.onset_hz * 1.5, xtol=1e-13)
    assert gears.onset_hz == pytest.approx(onset, rel=1e-12)
    words = 'a gear at rest stays at rest'
    assert any(words in line for line in gears.at(frequency_hz=0.99 * gears.onset_hz).warnings())
    assert not any(words in line
                   for line in gears.at(frequency_hz=1.01 * gears.onset_hz).warnings())


def test_onset_without_load_or_drive() -> None:
    """Without a load any drive lifts the gear; no drive lifts a loaded one."""
    assert Gears(**{**PAIR, 'torque_n_m': 0.0}).onset_hz == 0.0
    assert Gears(**{**PAIR, 'drive_rad': 0.0}).onset_hz == math.inf


def test_a_plausible_pair_is_not_doubted() -> None:
    """No line where nothing is odd."""
    assert Gears(**PAIR).warnings() == ()


@pytest.mark.parametrize('changes, words', [
    ({'driver_radius_m': 40.0, 'drive_rad': 3e-6}, 'pitch radii are 40 m'),
    ({'backlash_m': 0.1}, 'is it in millimetres'),
    ({'inertia_kg_m2': 20.0}, 'steel disc'),
    ({'drive_rad': 0.5}, '28.6 degrees'),
    ({'drive_m': 0.02}, 'drive_m = 0.02 is 0.5 of the pitch radius'),
    ({'drive_m': 1e-8}, 'is 0.0001 of the backlash'),
    ({'frequency_hz': 2.0 * math.pi * 3000.0}, 'is the frequency in Hz, not rad/s?'),
    ({'frequency_hz': 40.0 * 2.0 * math.pi, 'torque_n_m': 1e-4}, 'is it in N m'),
    ({'torque_n_m': 2.0}, 'above 324.9 Hz, or below 0.0304 N m'),
])
def test_what_looks_like_a_wrong_unit(changes: dict[str, float], words: str) -> None:
    """Each has a line that names it."""
    lines = Gears(**PAIR).at(**changes).warnings()
    assert any(words in line for line in lines), lines


@pytest.mark.parametrize('name', [
    'inertia_kg_m2', 'driver_radius_m', 'driven_radius_m', 'backlash_m', 'frequency_hz'])
@pytest.mark.parametrize('value', [0.0, -1.0, math.nan, math.inf, 'much'])
def test_a_gear_pair_of_nothing_is_refused(name: str, value: float) -> None:
    """What must be positive is named when it is not."""
    with pytest.raises(ValueError, match=f'^{name} = '):
        Gears(**{**PAIR, name: value})


@pytest.mark.parametrize('changes, words', [
    ({'drive_m': 1e-4}, 'give either drive_rad or drive_m, not both'),
    ({'drive_rad': None}, 'give either drive_rad or drive_m, not neither'),
    ({'order': 2.0}, 'give either frequency_hz or order and speed_rpm, not both'),
    ({'frequency_hz': None, 'speed_rpm': 800.0}, 'order and speed_rpm, not part of it'),
    ({'drive_rad': -0.1}, '^drive_rad = -0.1 is outside'),
    ({'restitution': 1.1}, '^restitution = 1.1 is outside'),
    ({'torque_n_m': 1e4}, '^gamma = .* load holds the flanks together'),
    ({'backlash_m': 1e-9}, '^alpha = .* it is drive_rad divided by'),
    ({'backlash': 1.0}, "^unknown quantity 'backlash'; known are inertia_kg_m2"),
])
def test_refusals_name_the_quantity(changes: dict[str, float], words: str) -> None:
    """Missing, twice, out of range or unknown: one line."""
    with pytest.raises(ValueError, match=words):
        Gears.of({**PAIR, **changes})


@pytest.mark.parametrize('name', ['inertia_kg_m2', 'torque_n_m', 'restitution'])
def test_what_is_missing_is_explained(name: str) -> None:
    """The line says what the quantity is, and its unit."""
    words, unit = QUANTITIES[name]
    with pytest.raises(ValueError) as caught:
        Gears.of({key: value for key, value in PAIR.items() if key != name})
    assert str(caught.value) == f'{name} is missing: {words} [{unit}]'
