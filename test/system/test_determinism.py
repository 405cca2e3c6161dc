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

"""The same bytes of EVENT whatever the tick, the rate, the load, the readers or the CPU."""

import inspect
import os
from pathlib import Path
import re
import subprocess
import sys

import numba
import numpy as np
import pytest
from sensor_msgs.msg import PointCloud2

from gear_rattle_ros.core.flight.closed_form import displace, later
from gear_rattle_ros.core.flight.elementary import relaxation
from gear_rattle_ros.core.flight.fingerprint import fingerprint
from gear_rattle_ros.core.model import Model
from gear_rattle_ros.messages import events_from_cloud
from gear_rattle_ros.qos import STREAM_INPUT

pytestmark = pytest.mark.long
ROOT = Path(__file__).parents[2]
COUNT = 20_000
# Noise and a ramp, which retunes at the end of every drive period.
COMMON = ('alpha:=0.57', 'noise:=0.001', 'seed:=11', 'alpha_target:=1.3', 'alpha_rate:=0.0001')


def run_simulator(start, node, spin, readers: int, *settings: str) -> list[bytes]:
    """Return the first events that each of some readers gets, as bytes."""
    batches: list[list[np.ndarray]] = [[] for _ in range(readers)]
    subscriptions = [
        node.create_subscription(
            PointCloud2, 'impacts', lambda cloud, own=own: own.append(events_from_cloud(cloud)),
            STREAM_INPUT) for own in batches]
    process = start('simulator', '--ros-args', *(
        word for setting in (*COMMON, f'wait_for_readers:={readers}', *settings)
        for word in ('-p', setting)))
    spin(lambda: all(sum(map(len, own)) >= COUNT for own in batches), 120.0)
    assert process.stop() == 0
    for subscription in subscriptions:
        node.destroy_subscription(subscription)
    return [np.concatenate(own)[:COUNT].tobytes() for own in batches]


def test_same_bytes_whatever_the_tick_rate_load_and_readers(start, rclpy_node, spin) -> None:
    """Real simulators: by the clock in short and long ticks, at full speed, beside busy loops."""
    found = run_simulator(start, rclpy_node, spin, 1, 'rate:=20000.0', 'tick:=0.003')
    found += run_simulator(start, rclpy_node, spin, 3, 'rate:=7000.0', 'tick:=0.2')
    busy = [subprocess.Popen([sys.executable, '-c', 'while True: pass']) for _ in range(3)]
    try:
        found += run_simulator(start, rclpy_node, spin, 2, 'rate:=0.0')
    finally:
        for process in busy:
            process.kill()
            process.wait()
    assert len(found) == 6
    assert len(set(found)) == 1


# Prints the bits of events and of the exponents of a noisy run.
BITS = """
from gear_rattle_ros.core.flight.fingerprint import fingerprint
from gear_rattle_ros.core.flight.simulation import Simulation
from gear_rattle_ros.core.model import Parameters, State
from gear_rattle_ros.core.stream.lyapunov import RunningLyapunov
lyapunov = RunningLyapunov()
lyapunov.update(Simulation(Parameters(0.57), State(), noise=1e-3).advance(20_000, 0.0, 20_000))
print(fingerprint(), lyapunov.report)
"""


def test_same_bits_on_the_oldest_cpu_of_this_kind(tmp_path: Path) -> None:
    """Without AVX and fused multiply-add, in kernels and in libm, the bits are the same."""
    oldest = {'NUMBA_CPU_NAME': 'x86-64', 'NUMBA_CPU_FEATURES': '',
              'NUMBA_CACHE_DIR': str(tmp_path), 'GLIBC_TUNABLES': 'glibc.cpu.hwcaps=-FMA,-AVX2'}
    here, there = (subprocess.run(
        [sys.executable, '-c', BITS], capture_output=True, text=True, check=True, cwd=ROOT,
        env=os.environ | others).stdout for others in ({}, oldest))
    assert here == there and fingerprint() in here and 'lambda_1=-0.2' in here


@pytest.mark.parametrize('kernel', [relaxation, displace, later])
def test_no_multiplication_is_fused_with_an_addition(kernel) -> None:
    """The machine code on this CPU, which may well have such instructions."""
    # Code from the cache cannot be looked at.
    options = {name: value for name, value in kernel.targetoptions.items() if name != 'cache'}
    assert not options.get('fastmath')
    fresh = numba.njit(**options)(kernel.py_func)
    fresh(*(Model(0.3, 0.3, 0.3, 0.3) if name == 'model' else 0.3
            for name in inspect.signature(kernel.py_func).parameters))
    (code,) = fresh.inspect_asm().values()
    assert 'mulsd' in code or 'mulpd' in code
    assert not re.search('fn?m(add|sub)', code)
