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
Impacts per second of one trajectory, next to the usual scan in numba and in C.

Everything is timed in the same run on one core, in turns, and the best of the turns counts.
The scan steps by 0.02 and bisects to 1e-14 on eqs. (4)-(5); it misses grazing impacts.
"""

import argparse
from collections.abc import Callable
import ctypes
import math
from pathlib import Path
import shutil
import subprocess
import tempfile
import time

import numba
import numpy as np

from gear_rattle_ros.core.flight.simulation import Simulation
from gear_rattle_ros.core.model import Parameters, State
from gear_rattle_ros.core.stream.lyapunov import RunningLyapunov
from gear_rattle_ros.core.stream.transients import TransientDetector

ALPHAS = (0.48, 1.244)
BETA, GAMMA, RESTITUTION = 0.1, 0.1, 0.9
STEP = 0.02
BATCH = 4096
FAR = 2**31
Scan = Callable[..., int]


@numba.njit(nogil=True, error_model='numpy')
def displacement(d, p, s0, v0, a, b, g):  # type: ignore[no-untyped-def]
    """Return eq. (4) as printed."""
    k = g / b
    return (s0 + a * (math.sin(p + d) - math.sin(p)) + k * d
            + (1.0 - math.exp(-b * d)) / b * (v0 - a * math.cos(p) - k))


@numba.njit(nogil=True, error_model='numpy')
def scan_numba(state, count, a, b, g, r, step, out):  # type: ignore[no-untyped-def]
    """Follow `count` impacts by scan and bisection; the twin of flight_scan.c."""
    p, s0, v0 = state
    for n in range(count):
        low, high = 0.0, step
        s = displacement(high, p, s0, v0, a, b, g)
        while -1.0 <= s <= 0.0:
            low = high
            high += step
            s = displacement(high, p, s0, v0, a, b, g)
        wall = 0.0 if s > 0.0 else -1.0
        while high - low > 1e-14:
            middle = 0.5 * (low + high)
            if middle in (low, high):
                break
            s = displacement(middle, p, s0, v0, a, b, g)
            if -1.0 <= s <= 0.0:
                low = middle
            else:
                high = middle
        k = g / b
        v = a * math.cos(p + low) + (v0 - a * math.cos(p) - k) * math.exp(-b * low) + k
        p = (p + low) % (2.0 * math.pi)
        s0 = wall
        v0 = -r * v
        out[n, 0] = p
        out[n, 1] = wall
        out[n, 2] = v
    state[:] = p, s0, v0
    return count


def build_scan_c(folder: Path) -> Scan | None:
    """Compile flight_scan.c; None where there is no compiler."""
    compiler = shutil.which('cc')
    if compiler is None:
        return None
    library = folder / 'flight_scan.so'
    subprocess.run(
        [compiler, '-O3', '-march=native', '-shared', '-fPIC', '-o', str(library),
         str(Path(__file__).with_name('flight_scan.c')), '-lm'], check=True)
    function = ctypes.CDLL(str(library)).scan
    pointer, number = np.ctypeslib.ndpointer(np.float64, flags='C'), ctypes.c_double
    function.argtypes = [pointer, ctypes.c_long, *[number] * 5, pointer]
    function.restype = ctypes.c_long
    return function


def rate(work: Callable[[], int]) -> float:
    """Return impacts per second of processor time."""
    begin = time.process_time()
    count = work()
    return count / (time.process_time() - begin)


def contestants(alpha: float, count: int, scan_c: Scan | None) -> dict[str, Callable[[], int]]:
    """Return what is timed at one alpha: name and work, each from a settled state."""
    simulation = Simulation(Parameters(alpha, BETA, GAMMA, RESTITUTION), State(0, 1.0, 0.0, -0.6))
    simulation.advance(FAR, 0.0, 2000)
    events = simulation.advance(FAR, 0.0, count)
    last = events[-1]
    start = [float(last[name]) for name in ('phase', 'displacement', 'velocity_after')]
    room = np.empty((count, 3))

    def advance() -> int:
        done = 0
        while done < count:
            done += len(simulation.advance(FAR, 0.0, BATCH))
        return done

    def feed(reader: RunningLyapunov | TransientDetector) -> Callable[[], int]:
        def work() -> int:
            for k in range(0, count, BATCH):
                reader.update(events[k:k + BATCH])
            return count
        return work

    def scan(function: Scan) -> Callable[[], int]:
        few = count // 20

        def work() -> int:
            state = np.array(start)
            return function(state, few, alpha, BETA, GAMMA, RESTITUTION, STEP, room)
        return work

    result = {
        'Simulation.advance, events written out': advance,
        'scan 0.02 and bisection, numba': scan(scan_numba),
    }
    if scan_c is not None:
        result['scan 0.02 and bisection, C'] = scan(scan_c)
    result['RunningLyapunov.update'] = feed(RunningLyapunov())
    result['TransientDetector.update'] = feed(TransientDetector())
    return result


def main() -> None:
    """Time everything and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n\n')[0])
    parser.add_argument('--impacts', type=int, default=1_000_000, help='impacts in each turn')
    parser.add_argument('--turns', type=int, default=5, help='turns, of which the best counts')
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        scan_c = build_scan_c(Path(folder))
        if scan_c is None:
            print('no C compiler (cc): the scan in C is left out')
        for alpha in ALPHAS:
            works = contestants(alpha, options.impacts, scan_c)
            for work in works.values():
                work()
            best = dict.fromkeys(works, 0.0)
            for _ in range(options.turns):
                for name, work in works.items():
                    best[name] = max(best[name], rate(work))
            own = best['Simulation.advance, events written out']
            print(f'\nalpha {alpha}, one core{"impacts/s":>32}{"advance is":>14}')
            for name, found in best.items():
                ratio = f'{own / found:.1f} times' if name.startswith('scan') else ''
                print(f'  {name:40}{found:12.3g}{ratio:>14}')


if __name__ == '__main__':
    main()
