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

"""What the suite shows: numbers, and words where there are none."""

import io
import math

from rich.console import Console

from gear_rattle_ros.nodes.suite.display import render, Status


def shown(status: Status) -> str:
    """Return the table as text."""
    console = Console(width=80, file=io.StringIO(), record=True)
    console.print(render(status))
    return ' '.join(console.export_text().replace('│', ' ').split())


def test_infinite_exponents_are_explained() -> None:
    """-inf has its reason beside it, in the table and on the line."""
    status = Status(exponents={'lambda_1': -math.inf, 'lambda_2': -math.inf, 'sticks': 43.0,
                               'impacts': 2957.0, 'impulse_balance': 2.5, 'window': 1000.0,
                               'exact_impulse_balance': 2.5})
    words = 'the gear stuck at 43 of 2,957 impacts, where all memory is lost (superstable)'
    assert words in shown(status) and words in status.line()
    assert 'impulse balance +2.500000' in shown(status)
    status.exponents['lambda_1'] = status.exponents['lambda_2'] = 0.25
    assert 'superstable' not in shown(status) + status.line()


def test_finite_time_exponent_has_its_number_of_retunes() -> None:
    """In a ramp it is all there is."""
    status = Status(exponents={'lambda_1_finite': 0.25, 'finite_retunes': 497.0, 'window': 1e3})
    assert '+0.250000 over 497 retunes' in shown(status)
    assert 'last 1,000 impacts +0.250000 over 497 retunes' in status.line()
