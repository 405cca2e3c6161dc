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

"""The display of the suite in the terminal, updated a few times a second."""

import dataclasses
import math

from rich import box
from rich.console import Group
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from ...core.stream.report_values import infinite_in_words
from ...core.words import counted


@dataclasses.dataclass
class Status:
    """The present state of the run."""

    phase: str = 'starting'
    seconds: float = 0.0
    duration: float = 0.0
    impacts: int = 0
    impacts_per_second: float = 0.0
    alpha: float = math.nan
    exponents: dict[str, float] = dataclasses.field(default_factory=dict)
    trajectory: str = ''
    lost: dict[str, int] = dataclasses.field(default_factory=dict)
    gaps: dict[str, int] = dataclasses.field(default_factory=dict)
    bag_bytes: int = 0
    # By how much the system clock was set back [s].
    set_back: float = 0.0
    # The web page that shows the run, empty for none.
    page: str = ''

    def rows(self) -> list[tuple[str, str]]:
        def exponent(name: str, error: str = '') -> str:
            value, uncertainty = (self.exponents.get(key, math.nan) for key in (name, error))
            text = '-' if math.isnan(value) else f'{value:+.6f}'
            return text if math.isnan(uncertainty) else f'{text} ± {uncertainty:.6f}'

        whole = f' of {self.duration:.0f} s' if self.duration > 0.0 else ' s, until stopped'
        retunes = self.exponents.get('finite_retunes', 0.0)
        infinite = infinite_in_words(self.exponents)
        where = ', '.join(f'{name} {count}' for name, count in self.lost.items() if count)
        return [
            ('time', f'{self.seconds:.0f}{whole}'),
            ('impacts', f'{self.impacts:,}'),
            ('impacts per second', f'{self.impacts_per_second:,.0f}'),
            ('alpha [1]', f'{self.alpha:g}'),
            ('lambda_1 per impact', exponent('lambda_1', 'lambda_1_error')),
            (f'  last {counted(self.exponents.get("window", 0), "impact")}',
             exponent('lambda_1_finite')
             + (f' over {counted(retunes, "retune")}' if retunes > 0.0 else '')),
            ('lambda_2 per impact', exponent('lambda_2', 'lambda_2_error')),
            ('sum', exponent('sum')),
            ('  exact sum', exponent('exact_sum')),
            *([('', infinite)] if infinite else []),
            ('impulse balance', exponent('impulse_balance')),
            ('  exact', exponent('exact_impulse_balance')),
            ('averaged over', counted(self.exponents.get('impacts', 0), 'impact')),
            ('trajectory', self.trajectory or '-'),
            ('gaps', f'{sum(self.gaps.values())}, {counted(sum(self.lost.values()), "impact")} '
             f'lost: {where}' if any(self.gaps.values()) else 'none'),
            *([('clock', f'set back by {self.set_back:,.0f} s: DDS may stand still; start again')]
              if self.set_back else []),
            ('bag', f'{self.bag_bytes / 1e6:.1f} MB'),
        ]

    def line(self) -> str:
        """Return everything on one line, for output that is not a terminal."""
        return ', '.join(f'{name.strip()} {value}'.strip() for name, value in self.rows())


def render(status: Status) -> Panel:
    table = Table(box=box.SIMPLE, show_header=False, padding=(0, 1))
    table.add_column(style='cyan', no_wrap=True)
    table.add_column()
    for name, value in status.rows():
        style = '' if name != 'gaps' else 'green' if value == 'none' else 'red'
        table.add_row(name, Text(value, style=style))
    hint = Text('Ctrl-C ends the run and keeps everything', style='dim')
    return Panel(Group(table, hint), title=f'gear rattling: {status.phase}', width=78)
