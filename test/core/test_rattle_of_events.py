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

"""Rattle against closed forms, against quadrature of the motion, and in SI units."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.integrate import trapezoid

from gear_rattle_ros import Gears, Parameters, rebuild, Simulation, State
from gear_rattle_ros.core.stream.rattle import (
    impulse_train,
    order_spectrum,
    rattle_of,
    RunningRattle,
)

TWO_PI = 2.0 * math.pi


def stretch(parameters, periods, skip=400, state=None):
    """Return the events of some whole drive periods, with a record at both ends."""
    simulation = Simulation(parameters, state or State())
    simulation.advance(skip, 0.0, 10_000_000)
    begin = simulation.retune(parameters)[-1:]
    events = simulation.advance(skip + periods, 0.0, 10_000_000)
    return np.concatenate([begin, events, simulation.retune(parameters)])


# Two flanks in turn; one flank with chatter and contact; the lower flank; without damping.
MOTIONS = pytest.mark.parametrize('parameters', [
    Parameters(), Parameters(0.3, 0.1, 0.2, 0.5), Parameters(0.3, 0.1, -0.2, 0.5),
    Parameters(0.3, 0.0, 0.2, 0.5)], ids=['both', 'upper', 'lower', 'undamped'])


def test_orbit_of_one_impact_a_period_has_its_closed_form():
    """
    An orbit of one impact of velocity 2 pi gamma/(1 + r) a period is an impulse once a period.

    All its orders have the mean force gamma.
    """
    parameters = Parameters(0.09)
    c = -0.9 * (v := TWO_PI * 0.1 / 1.9) - 1.0 + TWO_PI * 0.1 / -math.expm1(-TWO_PI * 0.1)
    phase = next(p for p in (math.acos(c / 0.09), TWO_PI - math.acos(c / 0.09))
                 if abs(impact_after(parameters, p, -0.9 * v) - TWO_PI) < 1e-9)
    events = stretch(parameters, 5, state=State(0, phase, 0.0, -0.9 * v))
    rattle = rattle_of(events)
    assert rattle.mode == 'upper' and rattle.contact_upper == 0.0 and rattle.rattle_index == 1.0
    assert rattle.rate_upper == pytest.approx(1.0 / TWO_PI, rel=1e-12)
    for name in ('rms', 'mean', 'peak'):
        assert getattr(rattle, f'speed_{name}') == pytest.approx(v, rel=1e-9)
    assert rattle.impulse_mean == pytest.approx(TWO_PI * 0.1, rel=1e-9)
    assert rattle.power_lost == pytest.approx(0.19 * v**2 / 2.0 / TWO_PI, rel=1e-9)
    assert np.abs(order_spectrum(events, np.arange(30.0))) == pytest.approx(0.1, rel=1e-9)


def impact_after(parameters, phase, velocity):
    """Return the time to the next impact."""
    simulation = Simulation(parameters, State(0, phase, 0.0, velocity))
    event = simulation.advance(10, 0.0, 2)[-1]
    return TWO_PI * event['cycle'] + event['phase'] - phase


@MOTIONS
def test_forces_and_powers_balance(parameters):
    """The mean force is gamma; what the driver gives is lost at impacts and to the drag."""
    rattle = rattle_of(stretch(parameters, 24))
    assert rattle.force_upper - rattle.force_lower == pytest.approx(parameters.gamma, abs=1e-12)
    assert rattle.force_upper >= 0.0 and rattle.force_lower >= 0.0
    assert rattle.power_in == pytest.approx(rattle.power_lost + rattle.power_drag, abs=1e-12)


@MOTIONS
def test_drag_and_spectrum_follow_from_the_motion_sampled(parameters):
    """With V the gear's own velocity, drag is beta <V^2> and F(k) = gamma - (i k + beta) V(k)."""
    events = stretch(parameters, 12)
    motion = rebuild(events, 1e-3)
    own = motion.velocity - parameters.alpha * np.cos(motion.tau)

    def mean(values):
        return trapezoid(values, motion.tau) / (12 * TWO_PI)

    assert rattle_of(events).power_drag == pytest.approx(
        mean(parameters.beta * own**2), rel=1e-5, abs=1e-15)
    orders = np.arange(0.0, 6.0, 1.0 / 12.0)
    expected = [parameters.gamma * (k == 0.0) - (1j * k + parameters.beta) * mean(
        own * np.exp(-1j * k * motion.tau)) for k in orders]
    assert order_spectrum(events, orders) == pytest.approx(np.array(expected), abs=3e-6)


def test_a_gear_at_rest_is_carried_by_its_flank():
    """In permanent contact the flank carries the load and moves the gear against the drag."""
    rattle = rattle_of(stretch(Parameters(0.05), 3))
    assert (rattle.mode, rattle.contact_upper, rattle.rattle_index) == ('none', 1.0, 0.0)
    assert rattle.power_in == pytest.approx(0.1 * 0.05**2 / 2.0, rel=1e-12)
    assert math.isnan(rattle.speed_rms)


def test_slow_impacts_count_for_forces_and_powers_only():
    events = stretch(Parameters(0.3, 0.1, 0.2, 0.5), 24)
    every, fast = rattle_of(events), rattle_of(events, above=0.01)
    speeds = np.abs(events['velocity'][events['kind'] <= 1])
    assert fast.rate_upper * fast.duration == pytest.approx(np.sum(speeds >= 0.01))
    assert fast.speed_mean == pytest.approx(np.mean(speeds[speeds >= 0.01]))
    assert fast.rate_upper < every.rate_upper
    assert (fast.power_lost, fast.force_upper) == (every.power_lost, every.force_upper)


def test_scales_multiply_what_has_units():
    """Backlash twice as wide: speeds double, losses are four times as large, rates stay."""
    gears = Gears(inertia_kg_m2=1.4e-3, driver_radius_m=0.04, driven_radius_m=0.05,
                  backlash_m=1e-4, drag_n_m_s_per_rad=0.02, torque_n_m=0.05, drive_rad=0.0017,
                  frequency_hz=50.0, restitution=0.8)
    wide = gears.at(backlash_m=2e-4, drive_rad=0.0034, torque_n_m=0.1)
    small, large = (rattle_of(stretch(each.parameters, 4)).in_si(each.scales)
                    for each in (gears, wide))
    for name, factor in (('rate_upper_per_s', 1.0), ('speed_rms_m_per_s', 2.0),
                         ('impulse_peak_n_s', 2.0), ('force_upper_n', 2.0),
                         ('loss_mean_j', 4.0), ('power_lost_w', 4.0), ('rattle_index', 1.0),
                         ('contact_upper', 1.0), ('duration_s', 1.0)):
        assert large[name] == pytest.approx(factor * small[name], rel=1e-9)
    assert small['force_upper_n'] - small['force_lower_n'] == pytest.approx(0.05 / 0.05)


def test_running_rattle_does_not_depend_on_how_the_stream_is_cut():
    events = stretch(Parameters(1.0), 50)
    whole = RunningRattle()
    whole.update(events)
    cut = RunningRattle()
    for first in range(0, len(events), 7):
        cut.update(events[first:first + 7])
    assert whole.take() == cut.take() == rattle_of(events)
    # What follows is a stretch of its own; nothing has happened since.
    assert dataclasses.astuple(cut.take())[0] == 0.0


def test_running_rattle_begins_anew_at_a_hole_and_at_a_reset():
    simulation = Simulation(Parameters(), State())
    events = [simulation.advance(20, 0.0, 1000), simulation.reset(1.0, -0.5, 0.3),
              simulation.advance(40, 0.0, 1000)]
    running = RunningRattle()
    running.update(np.concatenate(events))
    assert running.take() == rattle_of(np.concatenate(events[1:]))
    after = simulation.advance(60, 0.0, 1000)
    running.update(after[5:])
    assert running.take() == rattle_of(after[5:])


def test_impulse_train_keeps_impulses_and_their_spectrum():
    """Below half of the rate, the samples have the Fourier sum of the impulses."""
    random = np.random.default_rng(2)
    times, impulses = random.uniform(0.1, 0.9, 50), random.normal(size=50)
    samples = impulse_train(times, impulses, 8000.0, 8000)
    for frequency in (0.0, 100.0, 1234.5):
        expected = np.sum(impulses * np.exp(-2j * math.pi * frequency * times))
        measured = np.sum(samples * np.exp(-2j * math.pi * frequency * np.arange(8000) / 8000.0)
                          ) / 8000.0
        assert measured == pytest.approx(expected, abs=1e-2)
