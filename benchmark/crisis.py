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

"""
The boundary crisis located by programs of another kind.

The place where the manifolds of the saddle touch: scipy's DOP853 with events integrates eq. (3)
itself, finds the saddle by Newton's method with differences, and follows its unstable manifold.
Escapes at amplitudes on both sides: a C program that scans flights with a fixed step counts them,
next to the lanes, with as many trajectories. Run it as: python benchmark/crisis.py
"""

from concurrent.futures import ThreadPoolExecutor
import ctypes
import math
import pathlib
import shutil
import subprocess
import tempfile
import time

import numpy as np

from gear_rattle_ros.attractors.plane import Plane
from gear_rattle_ros.core.flight.lanes import new_tiles
from gear_rattle_ros.core.many.escape import CAPTURED, last_until_captured
from gear_rattle_ros.core.model import Parameters
from gear_rattle_ros.core.orbits.orbit import Orbit
from gear_rattle_ros.core.path import Path
from gear_rattle_ros.studies.skeleton.tangency import carry, Contact, Tangency, touch
from gear_rattle_ros.studies.transitions.crisis import find_ending, radius_of

BETA, GAMMA, RESTITUTION = 0.1, 0.1, 0.9
PATH = Path.over(alpha=(1.24, 1.25))
ALPHAS = (1.2347058, 1.240, 1.243, 1.2431, 1.2433, 1.2436, 1.244)
TRAJECTORIES, LIMIT, SKIP = 64, 40_000, 300
STEP = 0.02
# Turns about the saddle after a return: the unstable coordinate is then exact.
TURNS = 3


def next_impact(phase, velocity, wall, alpha):  # type: ignore[no-untyped-def]
    """Integrate from an impact to the next; wall is 0 (upper) or -1."""
    from scipy.integrate import solve_ivp

    def flow(t, y):  # type: ignore[no-untyped-def]
        return (y[1], GAMMA - BETA * y[1] - alpha * math.sin(t) + alpha * BETA * math.cos(t))

    def upper(t, y):  # type: ignore[no-untyped-def]
        return y[0]

    def lower(t, y):  # type: ignore[no-untyped-def]
        return y[0] + 1.0

    upper.terminal = lower.terminal = True  # type: ignore[attr-defined]
    upper.direction, lower.direction = 1.0, -1.0  # type: ignore[attr-defined]
    # Events are found on the interpolant: short steps make it as exact as the steps are.
    found = solve_ivp(flow, (phase, phase + 60.0), (wall, -RESTITUTION * velocity), 'DOP853',
                      events=(upper, lower), rtol=1e-13, atol=1e-15, max_step=0.06)
    return (float(found.t[-1]) % (2.0 * math.pi), float(found.y[1, -1]),
            0.0 if len(found.t_events[0]) else -1.0)


def after(point, wall, count, alpha):  # type: ignore[no-untyped-def]
    """Follow a number of impacts."""
    phase, velocity = point
    for _ in range(count):
        phase, velocity, wall = next_impact(phase, velocity, wall, alpha)
    return np.array([phase, velocity])


def turned(difference):  # type: ignore[no-untyped-def]
    """Take the phase of a difference to [-pi, pi)."""
    return difference - np.array([2.0 * math.pi * math.floor(difference[0] / (2.0 * math.pi)
                                                             + 0.5), 0.0])


def saddle_by_scipy(guess, wall, period, alpha):  # type: ignore[no-untyped-def]
    """Newton's method with central differences; returns the point and the derivative."""
    point, h = np.array(guess, float), 1e-5
    for _ in range(6):
        derivative = np.stack([
            turned(after(point + step, wall, period, alpha)
                   - after(point - step, wall, period, alpha)) / (2.0 * h)
            for step in (np.array([h, 0.0]), np.array([0.0, h]))], axis=1)
        defect = turned(after(point, wall, period, alpha) - point)
        point = point - np.linalg.solve(derivative - np.eye(2), defect)
        if np.max(np.abs(defect)) < 1e-12:
            break
    return point, derivative


def edge_by_scipy(contact: Contact, place: float, impacts: int, seed: float, alpha: float
                  ) -> float:
    """Return how far the unstable manifold goes beyond the stable one near a place on it."""
    guess = carry(contact.target.orbit, PATH, alpha)
    wall = -float(guess.walls[0])
    period = guess.impacts
    point, derivative = saddle_by_scipy(guess.points[0], wall, period, alpha)
    values, vectors = np.linalg.eig(derivative)
    first = int(np.argmax(np.abs(values)))
    rows = np.linalg.inv(vectors)
    away = math.copysign(1.0, float(vectors[:, first] @ contact.source.unstable))

    def beyond(where: float) -> float:
        start = point + away * seed * values[first]**where * vectors[:, first]
        end = turned(after(start, wall, impacts + TURNS * period, alpha) - point)
        return float(-away * rows[first] @ end / values[first]**TURNS)

    width = 2e-3
    for _ in range(3):
        tries = [beyond(place + shift) for shift in (-width, 0.0, width)]
        bend = tries[0] - 2.0 * tries[1] + tries[2]
        place += min(max(0.5 * width * (tries[0] - tries[2]) / bend, -width), width)
        width *= 0.5
    return beyond(place)


def compare_tangency() -> tuple[Orbit, Tangency]:
    """Print where the manifolds touch, by both programs; return the captor, and the tangency."""
    begin = time.perf_counter()
    _, end, (captor, *_) = find_ending(PATH, Plane(displacement=-0.5), '', 1)
    ours = touch(end, lambda count: None)
    spent = time.perf_counter() - begin
    print(f'tangency, ours:          alpha_c = {ours.value:.10f} +- {ours.uncertainty:.0e}  '
          f'({spent:.0f} s)', flush=True)
    begin = time.perf_counter()
    # Not the same point of the manifold: farther out, where rounding grows less.
    seed = 1e-5
    turns = math.log(seed / 1e-6) / math.log(ours.contact.source.expansion)
    alphas = [ours.value - 2e-6, ours.value + 2e-6]
    places = [ours.edge.place - turns] * 2
    edges = [edge_by_scipy(ours.contact, place, ours.edge.impacts, seed, alpha)
             for place, alpha in zip(places, alphas, strict=True)]
    slope = (edges[1] - edges[0]) / (alphas[1] - alphas[0])
    peer = alphas[0] - edges[0] / slope
    spent = time.perf_counter() - begin
    print(f'tangency, scipy DOP853:  alpha_c = {peer:.10f}; at -2e-6 {edges[0]:+.2e}, at +2e-6 '
          f'{edges[1]:+.2e} across the stable manifold  ({spent:.0f} s)')
    print(f'difference {peer - ours.value:+.1e}', flush=True)
    return captor, ours


def library(folder: pathlib.Path) -> ctypes.CDLL | None:
    """Build the scan."""
    compiler = shutil.which('cc')
    if compiler is None:
        print('no C compiler (cc) here: escapes are not counted by the scan')
        return None
    path = folder / 'scan.so'
    subprocess.run([compiler, '-O3', '-shared', '-fPIC', '-o', str(path),
                    str(pathlib.Path(__file__).with_name('crisis_scan.c')), '-lm'], check=True)
    scan = ctypes.CDLL(str(path))
    scan.escape.restype = ctypes.c_long
    scan.escape.argtypes = [ctypes.c_double] * 3 + [ctypes.c_long] + [ctypes.c_double] * 5
    return scan


def rate(lifetimes) -> str:  # type: ignore[no-untyped-def]
    """Put escapes over impacts at risk in words."""
    life = np.array([one for one in lifetimes if one < 0 or one > SKIP])
    escapes = int(np.count_nonzero(life > 0))
    at_risk = float(np.sum(np.where(life < 0, LIMIT, life) - SKIP))
    mean = (f'{at_risk / escapes:8,.0f} +- {at_risk / escapes**1.5:6,.0f}' if escapes
            else f'{"more than":>8s} {at_risk / 3.0:8,.0f}')
    return f'{escapes:4d} in {at_risk:9,.0f}  {mean}'


def compare_escapes(captor: Orbit, tangency: Tangency, scan: ctypes.CDLL) -> None:
    """Print escapes on both sides, by both programs."""
    print(f'escapes of {TRAJECTORIES} trajectories on s = -0.5, after {SKIP} impacts and before '
          f'{LIMIT:,}: escapes in impacts at risk, mean lifetime')
    print(f'{"alpha":>10s}  {"scan in C":38s}  {"lanes":38s}')
    for alpha in ALPHAS:
        parameters = Parameters(alpha=alpha)
        initial = Plane(displacement=-0.5).draw(parameters, TRAJECTORIES, 11)
        with ThreadPoolExecutor() as pool:
            peer = list(pool.map(lambda start, alpha=alpha: scan.escape(
                start['phase'], start['displacement'], start['velocity'], LIMIT, alpha, BETA,
                GAMMA, RESTITUTION, STEP), initial))
        lifetimes, fates, _ = last_until_captured(
            new_tiles(1)[0], initial, carry(captor, PATH, alpha).points,
            np.array([captor.impacts]), radius_of(captor, tangency), SKIP, TRAJECTORIES, LIMIT)
        ours = np.where(fates == CAPTURED, lifetimes, -1)
        print(f'{alpha:10.7f}  {rate(peer):38s}  {rate(ours):38s}', flush=True)


def main() -> None:
    """Compare both."""
    try:
        import scipy  # noqa: F401
    except ImportError:
        print('no scipy here: pip install scipy')
        return
    captor, tangency = compare_tangency()
    with tempfile.TemporaryDirectory() as folder:
        scan = library(pathlib.Path(folder))
        if scan is not None:
            compare_escapes(captor, tangency, scan)


if __name__ == '__main__':
    main()
