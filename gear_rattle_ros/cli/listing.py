"""The attractors at given parameters as a table in plain text."""

from collections.abc import Mapping

from ..attractors.catalogue import Attractor, Catalogue, Kind, OTHERS
from ..attractors.finding import CONSERVES, conserves_areas
from ..core.words import counted, in_columns


def listed(catalogue: Catalogue, cells: Mapping[int, int] | None = None) -> str:
    """List attractors, numbered as in the store and in every picture, with their cells."""
    if conserves_areas(catalogue.parameters):
        return CONSERVES
    headings = [' label', 'key', 'kind', ' random initial conditions [%]', 'period or exponents']
    attractors = list(catalogue.attractors)
    attractors += [Attractor(key, kind, label) for label, (key, kind) in OTHERS.items()
                   if label in (cells or {}) and label not in catalogue.labels]
    rows = [[str(each.label), each.key, each.kind.value,
             f'{100.0 * each.share:.2f} +- {100.0 * each.share_error:.2f}',
             _detail(each, catalogue)] for each in attractors]
    if cells is not None:
        headings.insert(3, ' grid [%]')
        for each, row in zip(attractors, rows, strict=True):
            row.insert(3, f'{100.0 * cells.get(each.label, 0) / sum(cells.values()):.3f}')
    return in_columns(headings, rows)


def _detail(each: Attractor, catalogue: Catalogue) -> str:
    if each.kind is Kind.UNSETTLED:
        return f'no orbit within {counted(catalogue.hold, "impact")}'
    if each.orbit:
        return (f'{counted(each.impacts, "impact")} in '
                f'{counted(each.drive_periods, "drive period")}, largest multiplier '
                f'{max(map(abs, each.multipliers)):.6f}')
    if not each.chaos:
        return ''
    return f'{counted(each.pieces, "piece")}, exponents ' + ', '.join(
        f'{value:.5f} +- {error:.5f}'
        for value, error in zip(each.exponents, each.errors, strict=True))
