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

"""Rattle of a gear pair: the answer, what it rests on, and its sound."""

import json
import wave

import numpy as np
import pytest

from gear_rattle_ros import Gears, Parameters, rattle, Simulation, State
from gear_rattle_ros.cli.trajectories.rattle import main
from gear_rattle_ros.figures.draw import draw
from gear_rattle_ros.figures.rattle import save_wav
from gear_rattle_ros.gear_pairs import read_gears
from gear_rattle_ros.store.store import Store

IDLER = {
    'inertia_kg_m2': 1.4e-3, 'driver_radius_m': 0.04, 'driven_radius_m': 0.05,
    'backlash_m': 1e-4, 'drag_n_m_s_per_rad': 0.02, 'torque_n_m': 0.05, 'drive_rad': 0.0017,
    'order': 2.0, 'speed_rpm': 850.0, 'restitution': 0.8}


@pytest.fixture(scope='module')
def both():
    """Return a gear pair that may rest or rattle, with the rattle of it."""
    gears = Gears(**IDLER).with_parameters(Parameters(0.093, restitution=0.8))
    return gears, rattle(gears, initial_conditions=100, periods=50, threads=1)


@pytest.fixture(scope='module')
def run_up():
    """Return a run-up over the onset of the idler gear."""
    return rattle(Gears(**IDLER), run_up=(700.0, 900.0), points=5, initial_conditions=40,
                  periods=50, threads=1)


def test_a_run_up_goes_on_where_it_was_cut_short(tmp_path, run_up):
    """To the same bits: a block that is not marked is made anew, what is there stays."""
    path = tmp_path / 'a.zarr'
    options = {'run_up': (700.0, 900.0), 'points': 5, 'initial_conditions': 40, 'periods': 50,
               'threads': 1, 'store': path}
    rattle(Gears(**IDLER), **options)
    store = Store(path)
    assert len(store.tiles) == 2
    store.mark(1, False)
    again = rattle(Gears(**IDLER), **options, resume=True)
    for name in run_up.data_vars:
        np.testing.assert_array_equal(again[name].values, run_up[name].values, name)
    # What is damaged is made anew, too.
    (path / 'state_force' / 'c.0.0').unlink()
    store.mark(0, False)
    again = rattle(Gears(**IDLER), **options, resume=True)
    np.testing.assert_array_equal(again['state_force'].values, run_up['state_force'].values)


def test_below_the_threshold_rattle_and_rest_coexist(both):
    """The orbit of one impact a period takes more than half of the initial conditions."""
    gears, found = both
    kinds = dict(zip(found.state_kind.values, found.state_share.values, strict=True))
    assert found.point_lift.item() == pytest.approx(0.93 * 1.01**0.5)
    assert 0.4 < found.point_share.item() < 0.8
    assert kinds['resting'] == pytest.approx(1.0 - found.point_share.item())
    moving = found.isel(state=int(np.argmax(found.state_kind.values == 'periodic')))
    assert moving.state_mode.item() == 'upper'
    # 2 pi gamma/(1 + r), once a period.
    assert moving.state_speed_rms_m_per_s.item() == pytest.approx(
        2.0 * np.pi * 0.1 / 1.8 * gears.scales.velocity_m_per_s)
    assert moving.state_rate_upper_per_s.item() == pytest.approx(2.0 * 850.0 / 60.0)


def test_the_smallest_kick_starts_rattle_and_a_smaller_one_does_not(both):
    gears, found = both
    kick = found.point_kick_m_per_s.item() / gears.scales.velocity_m_per_s

    def rattles(size):
        for phase in np.arange(128) * (2.0 * np.pi / 128):
            simulation = Simulation(gears.parameters, State(0, phase, 0.0, -size))
            simulation.advance(2000, 0.0, 100_000)
            if not simulation.is_permanently_at_rest:
                return True
        return False

    assert rattles(kick)
    assert not rattles(0.999 * kick)


def test_it_rests_exactly_below_the_onset(run_up):
    """Below the frequency of the closed form a gear at rest stays, above it none does."""
    onset = run_up.attrs['onset_hz']
    lifts = run_up.point_frequency_hz.values > onset
    assert lifts.any() and not lifts.all()
    assert ((run_up.point_lift.values > 1.0) == lifts).all()
    assert ((run_up.point_kick_m_per_s.values == 0.0) == lifts).all()
    assert (run_up.point_share.values[lifts] == 1.0).all()


def test_mean_force_and_powers_balance_in_si(both, run_up):
    """The mean force is T/R, and line 0 of the spectrum has it."""
    for gears, found in (both, (Gears(**IDLER), run_up)):
        periodic = np.isin(found.state_kind.values, ['periodic', 'resting'])
        force = gears.torque_n_m / gears.driven_radius_m
        assert (found.state_force_upper_n - found.state_force_lower_n).values[
            periodic] == pytest.approx(force, rel=1e-6)
        assert found.state_force.values[periodic, 0] == pytest.approx(force, rel=1e-6)
        assert found.state_power_in_w.values[periodic] == pytest.approx(
            (found.state_power_lost_w + found.state_power_drag_w).values[periodic], rel=1e-5)


def test_a_larger_gear_pair_of_the_same_parameters_rattles_alike(both):
    """Only the scales differ between gear pairs of the same dimensionless parameters."""
    gears, found = both
    other = Gears(**IDLER | {'backlash_m': 3e-4, 'speed_rpm': 2000.0, 'inertia_kg_m2': 5e-3}
                  ).with_parameters(gears.parameters)
    again = rattle(other, initial_conditions=100, periods=50, threads=1)
    assert again.state_share.values.tolist() == found.state_share.values.tolist()
    for name, scale in (('speed_peak_m_per_s', 'velocity_m_per_s'), ('loss_mean_j', 'energy_j'),
                        ('impulse_mean_n_s', 'impulse_n_s'), ('force', 'force_n')):
        ratio = getattr(other.scales, scale) / getattr(gears.scales, scale)
        assert again[f'state_{name}'].values == pytest.approx(
            ratio * found[f'state_{name}'].values, rel=1e-6, abs=1e-9, nan_ok=True)


def test_the_sound_has_an_impulse_for_every_impact(both, tmp_path):
    """In a second, 28 1/3 impacts of one strength."""
    gears, found = both
    with wave.open(str(save_wav(found, tmp_path / 'a.wav', 3.0))) as file:
        assert (file.getnchannels(), file.getframerate(), file.getnframes()) == (1, 48000, 144000)
        samples = np.frombuffer(file.readframes(144000), '<i2')
    peaks = np.flatnonzero((samples > 15000) & (np.roll(samples, -1) <= samples)
                           & (np.roll(samples, 1) < samples))
    assert len(peaks) == 85
    assert np.diff(peaks) / 48000.0 == pytest.approx(60.0 / 1700.0, abs=3e-5)


def test_the_pictures_have_the_onset_and_the_motions(both, run_up):
    assert len(draw(both[1]).axes[0].lines) == len(both[1].state)
    waterfall, _, speeds = draw(run_up).axes
    onset = run_up.attrs['onset_hz'] * 30.0
    assert waterfall.lines[0].get_ydata()[0] == speeds.lines[-1].get_ydata()[0] == pytest.approx(
        onset)


def test_the_command_answers(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / 'gears.yaml'
    path.write_text('\n'.join(f'{name}: {value}' for name, value in IDLER.items()))
    assert main(['--gears', str(path), '--initial-conditions', '20', '--torque-n-m', '0.5',
                 '--wav', 'a.wav', '--threads', '1']) == 0
    said = capsys.readouterr()
    assert 'none of the random initial conditions rattles' in said.out
    assert 'rests' in said.out and (tmp_path / 'a.wav').exists()
    store, = tmp_path.glob('*.zarr')
    assert 'wav' not in store.name


@pytest.mark.parametrize('words, expected', [
    ([], 'give its file with --gears'),
    (['--run-up', '900', '700'], 'run-up 900 to 700 is not from a positive speed_rpm'),
    (['--above', '-1'], 'above = -1.0 is outside'),
    (['--wav', 'a.mp3'], 'a.mp3 cannot be written, or does not end in .wav'),
])
def test_a_refusal_is_one_line(words, expected, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    gears = [] if not words else [word for name, value in IDLER.items() for word in (
        f'--{name.replace("_", "-")}', str(value))]
    assert main([*gears, *words]) == 2
    error = capsys.readouterr().err.strip().splitlines()[-1]
    assert expected in error


def test_the_dataset_says_which_gear_pair_it_is_of(both):
    gears, found = both
    assert Gears.of(json.loads(found.attrs['gears'])) == gears
    assert read_gears(None, **gears.given) == gears
