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

"""Reports of the analyses as named values: what is published live and recomputed from a bag."""

from collections.abc import Mapping
import itertools
import math
from typing import Final

from .hops import Hops
from .lyapunov import LyapunovReport
from .transients import TransientReport
from ..model import Wall

# Points of an orbit that are written down; one that sticks may have thousands.
POINTS_MOST: Final = 256


def lyapunov_values(report: LyapunovReport) -> dict[str, float]:
    """Name the values of an estimate: exponents per impact, errors, sums [1], and their place."""
    return {name: getattr(report, 'exponent_sum' if name == 'sum' else name) for name in (
        'lambda_1', 'lambda_2', 'lambda_1_error', 'lambda_2_error', 'sum', 'exact_sum',
        'lambda_1_finite', 'window', 'finite_retunes', 'mean_flight_time', 'impulse_balance',
        'exact_impulse_balance', 'epoch', 'sticks', 'impacts', 'index')}


def infinite_in_words(values: Mapping[str, float]) -> str:
    """Return in one sentence why an exponent is infinite; empty where none is."""
    sticks = values.get('sticks', 0.0)
    if values.get('lambda_1') == -math.inf and sticks > 0.0:
        return (f'-inf: the gear stuck at {sticks:,.0f} of {values.get("impacts", 0.0):,.0f} '
                'impacts, where all memory is lost (superstable)')
    if values.get('lambda_2') == -math.inf:
        return '-inf: without restitution an impact forgets the velocity before it (r = 0)'
    return ''


def transient_values(report: TransientReport) -> dict[str, object]:
    """Name the values of a report; an orbit's points are numbered from 0."""
    def add(*names: str) -> None:
        values.update((name, getattr(report, name)) for name in names)

    values: dict[str, object] = {'state': report.regime.value}
    add('epoch', 'index', 'start', 'retunes')
    if report.lifetime is None:
        add('impacts', 'kicked', 'exponent', 'exponent_error')
    else:
        add('lifetime')
    if report.orbit is None:
        return values
    values['orbit'] = report.key
    add('period_impacts', 'period_drive', 'multiplier')
    values['multipliers'] = ' '.join(str(complex(value)) for value in report.orbit.multipliers)
    if not math.isnan(report.spread_rms):
        add('spread_largest', 'spread_rms')
    if report.previous:
        add('previous', 'residence')
    points = zip(report.orbit.walls, report.orbit.points.tolist(), strict=True)
    for number, (wall, (phase, velocity)) in enumerate(itertools.islice(points, POINTS_MOST)):
        values[f'point_{number}'] = (
            f'{Wall(wall).label} wall, phase {phase!r}, velocity {velocity!r}')
    return values


def hop_values(hops: Hops, index: int) -> dict[str, float]:
    """Name what is known of hops up to an impact: occupation, rates per impact [1], cores."""
    stays = hops.stays.copy()
    if hops.home >= 0:
        stays[hops.home] += (index - hops.since) % 2**32
    total = (index - hops.begun) % 2**32
    names = [each.name for each in hops.known]
    values = {'index': float(index), 'impacts': float(total), 'attractors': float(len(names))}
    for number, known in enumerate(hops.known):
        values |= {f'{what} {names[number]}': value for what, value in (
            ('occupation', stays[number] / total if total else math.nan),
            ('radius', known.radius), ('spread', hops.spread(number)[1]))}
    for (before, after), count in sorted(hops.counts.items()):
        if before >= 0 and after >= 0 and stays[before]:
            hop = f'{names[before]} to {names[after]}'
            values |= {f'hops {hop}': float(count), f'rate {hop}': count / stays[before],
                       f'rate_error {hop}': math.sqrt(count) / stays[before]}
    return values


def texts(values: Mapping[str, object]) -> dict[str, str]:
    """Write values down, floats with all their digits."""
    return {key: repr(float(value)) if isinstance(value, float) else str(value)
            for key, value in values.items()}
