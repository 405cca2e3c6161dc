"""The display of the suite in the terminal, updated a few times a second."""

import dataclasses
import math

from rich import box
from rich.console import Group
from rich.markup import escape
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

    def exponent(self, name: str, error: str = '') -> str:
        """Return an exponent as text, with its standard error."""
        value = self.exponents.get(name, math.nan)
        if math.isnan(value):
            return '-'
        text = f'{value:+.6f}'
        uncertainty = self.exponents.get(error, math.nan)
        return text if math.isnan(uncertainty) else f'{text} ± {uncertainty:.6f}'

    def finite(self) -> str:
        """Return the finite-time exponent, and the retunes that it crosses."""
        retunes = self.exponents.get('finite_retunes', 0.0)
        return self.exponent('lambda_1_finite') + (
            f' over {retunes:,.0f} retunes' if retunes > 0.0 else '')

    def time(self) -> str:
        """Return the time since the first impact, and the duration."""
        whole = f' of {self.duration:.0f} s' if self.duration > 0.0 else ' s, until stopped'
        return f'{self.seconds:.0f}{whole}'

    def line(self) -> str:
        """Return everything on one line, for output that is not a terminal."""
        return (
            f'{self.time()}: {counted(self.impacts, "impact")}, '
            f'{self.impacts_per_second:.0f}/s, alpha {self.alpha:g}, '
            f'lambda_1 {self.exponent("lambda_1", "lambda_1_error")}, finite-time '
            f'{self.finite()}, lambda_2 {self.exponent("lambda_2", "lambda_2_error")}, '
            f'sum {self.exponent("sum")} (exact {self.exponent("exact_sum")}), impulse balance '
            f'{self.exponent("impulse_balance")} (exact '
            f'{self.exponent("exact_impulse_balance")}), '
            f'{", ".join(filter(None, (infinite_in_words(self.exponents), self.trajectory)))}, '
            f'{counted(sum(self.gaps.values()), "gap")}, bag {self.bag_bytes / 1e6:.1f} MB')


def render(status: Status) -> Panel:
    """Return the live table."""
    table = Table(box=box.SIMPLE, show_header=False, padding=(0, 1))
    table.add_column(style='cyan', no_wrap=True)
    table.add_column()
    gaps, lost = sum(status.gaps.values()), sum(status.lost.values())
    where = ', '.join(f'{escape(name)} {count}' for name, count in status.lost.items() if count)
    whole = '[green]none[/]' if not gaps else (
        f'[red]{gaps}, {counted(lost, "impact")} lost: {where}[/]')
    exponents = status.exponents
    infinite = infinite_in_words(exponents)
    for name, value in (
        ('time', status.time()),
        ('impacts', f'{status.impacts:,}'),
        ('impacts per second', f'{status.impacts_per_second:,.0f}'),
        ('alpha [1]', f'{status.alpha:g}'),
        ('lambda_1 per impact', status.exponent('lambda_1', 'lambda_1_error')),
        (f'  last {counted(exponents.get("window", 0), "impact")}', status.finite()),
        ('lambda_2 per impact', status.exponent('lambda_2', 'lambda_2_error')),
        ('sum', status.exponent('sum')),
        ('  exact sum', status.exponent('exact_sum')),
        *([('', infinite)] if infinite else []),
        ('impulse balance', status.exponent('impulse_balance')),
        ('  exact', status.exponent('exact_impulse_balance')),
        ('averaged over', counted(exponents.get('impacts', 0), 'impact')),
        ('trajectory', escape(status.trajectory) or '-'),
        ('gaps', whole),
        ('bag', f'{status.bag_bytes / 1e6:.1f} MB'),
    ):
        table.add_row(name, value)
    hint = Text('Ctrl-C ends the run and keeps everything', style='dim')
    return Panel(Group(table, hint), title=f'gear rattling: {status.phase}', width=78)
