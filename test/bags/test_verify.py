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

"""Bags verified from themselves: made here record by record, and damaged on purpose."""

from collections.abc import Callable
import dataclasses
from pathlib import Path

from bag_maker import padded, START, STEP, story, topic
from builtin_interfaces.msg import Time
import numpy as np
import pytest
from rclpy.serialization import serialize_message

from gear_rattle_ros.bags import BagWriter
from gear_rattle_ros.bags.verify import verify
from gear_rattle_ros.cli.bags.verify import main
from gear_rattle_ros.core.flight.fingerprint import fingerprint
from gear_rattle_ros.core.flight.simulation import Simulation
from gear_rattle_ros.core.model import EventArray, Parameters, State
from gear_rattle_ros.core.stream.lyapunov import RunningLyapunov
from gear_rattle_ros.core.stream.report_values import (
    hop_values,
    lyapunov_values,
    transient_values,
)
from gear_rattle_ros.core.stream.transients import TransientDetector
from gear_rattle_ros.messages import cloud_from_events, diagnostic_array, named_values

TYPES = {
    '/impacts': 'sensor_msgs/msg/PointCloud2', '/lyapunov': 'sensor_msgs/msg/JointState',
    '/transient': 'diagnostic_msgs/msg/DiagnosticArray',
    '/diagnostics': 'diagnostic_msgs/msg/DiagnosticArray',
    '/hops': 'sensor_msgs/msg/JointState',
}


class Log:
    """A bag as nodes would have recorded it; each node may come in late."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.writer = BagWriter(path)
        self.channels = {name: self.writer.add_topic(topic(name, kind))
                         for name, kind in TYPES.items()}
        self.number = 0
        self.running = RunningLyapunov(100)
        self.detector = TransientDetector(1e-3)

    def put(self, name: str, message: object) -> None:
        """Write a message."""
        self.number += 1
        self.writer.write(self.channels[name], START + STEP * self.number, 0, self.number,
                          padded(serialize_message(message)))

    def batch(self, events: EventArray, stamp: Time, estimate: bool = True, report: bool = True,
              is_recorded: bool = True, bend: Callable[[dict], None] | None = None) -> None:
        """Write a batch and what the nodes publish after it."""
        if is_recorded:
            self.put('/impacts', cloud_from_events(events, stamp))
        if estimate:
            self.running.update(events)
            values = lyapunov_values(self.running.report)
            if bend:
                bend(values)
            self.put('/lyapunov', named_values(values, stamp))
        if report:
            for change in self.detector.update(events):
                self.put('/transient', diagnostic_array(
                    'transients: trajectory', '', 'ok', '',
                    transient_values(change) | {'tolerance': 1e-3, 'letter': 'B'}, stamp))

    def kernels(self, name: str) -> None:
        """Let the simulator report which kernels it has."""
        self.put('/diagnostics', diagnostic_array(
            'simulator: simulator', '', 'ok', '', {'kernels': name}, Time()))


def batches(size: int = 200) -> list[EventArray]:
    """Return a steered run: a transient onto an orbit, a retune, a reset, another orbit."""
    s = Simulation(Parameters(0.48), State(velocity=-0.5), seed=3)
    parts = [s.advance(10**6, 0.0, 3000), s.retune(Parameters(1.244)),
             s.advance(10**6, 0.0, 2000), s.reset(1.0, -0.5, 0.2), s.retune(Parameters(0.48)),
             s.advance(10**6, 0.0, 2500)]
    whole = np.concatenate(parts)
    return [whole[i:i + size] for i in range(0, len(whole), size)]


def test_a_whole_run_is_verified(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Every flight, estimate and report is reproduced; the .mcap file alone will do."""
    log = Log(tmp_path / 'bag')
    log.kernels(fingerprint())
    for number, events in enumerate(batches()):
        log.batch(events, Time(sec=number // 3))
    log.writer.close()
    verdict = verify(tmp_path / 'bag')
    assert verdict.is_verified, verdict
    assert (verdict.events, verdict.flights, verdict.epochs) == (7503, 7502, 4)
    changes = TransientDetector(1e-3).update(np.concatenate(batches()))
    assert (verdict.exponents, verdict.transients) == (38, len(changes))
    assert len(changes) >= 5
    assert not verdict.beyond
    assert main([str(tmp_path / 'bag'), str(tmp_path / 'bag' / 'bag_0.mcap')]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 2
    assert all('verified: 7,503 events' in line for line in lines)


def test_nodes_that_come_in_late_or_again(tmp_path: Path) -> None:
    """An average begins where its node came in, as the estimates themselves show."""
    log = Log(tmp_path / 'bag')
    for number, events in enumerate(batches()):
        if number == 9:
            log.running, log.detector = RunningLyapunov(100), TransientDetector(1e-3)
        # They come in at the third batch, are started anew at the tenth, and publish little.
        log.batch(events, Time(sec=number), number >= 2, number >= 2)
    log.writer.close()
    verdict = verify(tmp_path / 'bag')
    assert verdict.is_verified, verdict
    assert (verdict.exponents, verdict.beyond) == (36, 0)


def test_a_bag_that_begins_in_the_middle(tmp_path: Path) -> None:
    """What rests on events before the bag is counted apart; after a reset nothing does."""
    log = Log(tmp_path / 'bag')
    for number, events in enumerate(batches()):
        log.batch(events, Time(sec=number), is_recorded=number >= 4)
    log.writer.close()
    verdict = verify(tmp_path / 'bag')
    assert verdict.is_verified, verdict
    assert 4 <= verdict.beyond <= 35
    assert verdict.exponents >= 13
    assert verdict.transients >= 2


def test_a_wrong_estimate_or_report_is_found(tmp_path: Path) -> None:
    """One bit of one number, one digit of one text."""
    def bend(values: dict[str, float]) -> None:
        values['lambda_2'] = np.nextafter(values['lambda_2'], 1.0)

    log = Log(tmp_path / 'bent')
    for number, events in enumerate(batches()):
        log.batch(events, Time(sec=number), bend=bend if number == 20 else None)
    log.writer.close()
    fault = verify(tmp_path / 'bent').fault
    assert 'lambda_2 is' in fault
    assert f'impact {batches()[20]["index"][-1]}' in fault
    log = Log(tmp_path / 'untrue')
    for number, events in enumerate(batches()):
        log.batch(events, Time(sec=number))
        if number == 20:
            log.put('/transient', diagnostic_array(
                'transients: trajectory', '', 'ok', '', {
                    'state': 'transient', 'epoch': 1, 'index': 3456, 'start': 3456,
                    'tolerance': 1e-3}, Time(sec=number)))
    log.writer.close()
    assert "report 'transient' at impact 3456" in verify(tmp_path / 'untrue').fault


@pytest.mark.parametrize('bent', ['', 'rate A to B', 'occupation B', 'index'])
def test_counts_of_hops_are_reproduced(tmp_path: Path, bent: str) -> None:
    """Each at its moment, where two batches have one stamp, too; a hop more or less is found."""
    whole = Simulation(Parameters(0.48), State(velocity=-1.0), noise=0.02, seed=1).advance(
        10**8, 0.0, 20_000)
    log = Log(tmp_path / 'bag')
    for number, events in enumerate(np.array_split(whole, 40)):
        stamp = Time(sec=number // 2)
        log.batch(events, stamp, estimate=False)
        if log.detector.hops.known:
            values = hop_values(log.detector.hops, log.detector.index)
            if number == 35 and bent:
                values[bent] += 1e-3 if bent != 'index' else 1.0
            log.put('/hops', named_values(values, stamp))
    log.writer.close()
    verdict = verify(tmp_path / 'bag')
    assert log.detector.hops.counts[0, 1] > 5
    assert verdict.is_verified == (not bent) and bool(verdict.fault) == bool(bent)
    if bent:
        assert "the report 'hops' at impact" in verdict.fault
    else:
        assert verdict.hops > 35 and f'{verdict.hops} counts of hops reproduced' in str(verdict)


@pytest.mark.parametrize(('off', 'holds'), [(1e-12, True), (1e-6, False)])
def test_the_orbit_of_a_report_counts_as_far_as_it_is_known(
        tmp_path: Path, off: float, holds: bool) -> None:
    """Another version, or another library of linear algebra, has other last digits."""
    log = Log(tmp_path / 'bag')
    for number, events in enumerate(batches()):
        log.batch(events, Time(sec=number), estimate=False, report=False)
        for change in log.detector.update(events):
            if change.orbit:
                change = dataclasses.replace(change, orbit=dataclasses.replace(
                    change.orbit, points=change.orbit.points * (1.0 + off)))
            log.put('/transient', diagnostic_array(
                '', '', 'ok', '', transient_values(change) | {'tolerance': 1e-3},
                Time(sec=number)))
    log.writer.close()
    found = verify(tmp_path / 'bag')
    assert bool(found.fault) is not holds, found.fault


def test_the_first_wrong_record_is_named(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """By message, place, index and epoch; and what the kernels have to do with it."""
    for name, kernels, words in (
            ('a', 'f' * 16, f'other kernels ({"f" * 16})'), ('b', '', 'does not name the kernels'),
            ('c', fingerprint(), '')):
        log = Log(tmp_path / name)
        if kernels:
            log.kernels(kernels)
        for number, events in enumerate(batches()):
            if number == 7:
                events = events.copy()
                events['velocity'][33] = np.nextafter(events['velocity'][33], 9.0)
            log.batch(events, Time(sec=number), False, False)
        log.writer.close()
        assert main([str(tmp_path / name)]) == 1
        (line,) = capsys.readouterr().out.splitlines()
        assert 'not verified: record 33 of message 7 of /impacts, impact 1433, epoch 0: ' \
            'velocity is' in line
        assert words in line
        assert words or 'kernels' not in line


def test_holes_are_reported_and_not_verified(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """By impact and epoch; what is between them is, estimates of one who had it all aside."""
    log = Log(tmp_path / 'bag')
    for number, events in enumerate(batches()):
        log.batch(events, Time(sec=number), is_recorded=number not in (5, 6, 15))
    log.writer.close()
    assert main([str(tmp_path / 'bag')]) == 1
    first, *rest = capsys.readouterr().out.splitlines()
    assert 'not verified: 2 holes, what is between them follows' in first
    assert rest == ['  missing: 400 impacts, 1000 to 1399 (epoch 0)',
                    '  missing: 199 impacts, 3000 to 3198 (epochs 0 to 1)']


def test_noise_is_taken_as_recorded(tmp_path: Path) -> None:
    """What follows a kick follows from the velocity it gave."""
    log = Log(tmp_path / 'bag')
    log.batch(story(3000), Time())
    log.writer.close()
    verdict = verify(tmp_path / 'bag')
    assert verdict.is_verified, verdict
    assert verdict.kicked > 2900


def test_bad_bags_and_arguments(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One line and status 2; no events are status 1; the worst of several counts."""
    assert main([str(tmp_path / 'none')]) == 2
    assert 'does not exist' in capsys.readouterr().err
    log = Log(tmp_path / 'empty')
    log.writer.close()
    assert main([str(tmp_path / 'empty')]) == 1
    assert 'there are no events' in capsys.readouterr().out
    log = Log(tmp_path / 'odd')
    events = batches()[0].copy()
    events['phase'][7] = np.nan
    log.batch(events, Time(), False, False)
    log.writer.close()
    assert main([str(tmp_path / 'odd'), str(tmp_path / 'empty')]) == 1
    assert 'message 0 of /impacts: event 7 of the batch has phase = nan' in capsys.readouterr().out
    with pytest.raises(SystemExit) as ended:
        main([])
    assert ended.value.code == 2


def ramp_and_chatter() -> list[EventArray]:
    """Return a ramp through chaos, then chatter that sticks in every period, with late noise."""
    s = Simulation(Parameters(0.57), State(velocity=-1.0), seed=3)
    parts = []
    for k in range(1, 801):
        parts += [s.advance(k, 0.0, 1000), s.retune(Parameters(0.57 + 5e-6 * k))]
    parts += [s.retune(Parameters(5.0, 0.0159, 2.533, 0.7)), s.advance(10**6, 0.0, 2000)]
    s.noise = 1e-3
    parts += [s.advance(10**6, 0.0, 2000)]
    whole = np.concatenate(parts)
    return [whole[i:i + 60] for i in range(0, len(whole), 60)]


@pytest.mark.parametrize('comes_in, begins', [(0, 0), (5, 0), (0, 5), (3, 9)])
def test_ramps_sticking_and_noise_are_verified(tmp_path: Path, comes_in: int, begins: int) -> None:
    """What crosses retunes too, also where a node comes in, or the bag begins, in the ramp."""
    log = Log(tmp_path / 'bag')
    for number, events in enumerate(ramp_and_chatter()):
        log.batch(events, Time(sec=number), number >= comes_in, number >= comes_in,
                  is_recorded=number >= begins)
    log.writer.close()
    verdict = verify(tmp_path / 'bag')
    assert verdict.is_verified, verdict
    assert verdict.kicked > 1000
    assert 0.0 < verdict.imbalance < 1e-10
    if comes_in == begins == 0:
        assert verdict.beyond == 0
    assert 'impulse balance within' in str(verdict)
