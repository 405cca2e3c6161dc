"""The tool `lifetimes`: how long transients last before an orbit or rest ends them."""

import argparse
import dataclasses
import math
from typing import Final

import numpy as np
import numpy.typing as npt

from . import cli, options
from .attractors import describe
from .basins import add_settings, compute_basins, Settings, settings_of
from .catalogue import Catalogue
from .grid import Plane
from .store import Store
from ..core.classify import UNRESOLVED
from ..core.model import Parameters

NAME: Final = 'lifetimes'
# As in the paper.
CAP: Final = 5_000
TITLE: Final = 'Lifetimes of transients of the gear-rattling model'
# Random starts of the search for orbits: all transients end in some.
STARTS: Final = 256
HOLD: Final = 20_000
# The exponential tail begins at this share of the cap, where no other place is given.
TAIL: Final = 0.1
# Bins of the distribution, even in the logarithm.
BINS: Final = 200


@dataclasses.dataclass(frozen=True)
class Escape:
    """
    Escape times of many starts, censored at a cap.

    Attributes
    ----------
    cap : int
        Impacts after which a start was given up.
    starts, censored : int
        Starts, and those that were given up.
    begin : int
        Lifetime from which on the tail is taken to be exponential [impacts].
    in_tail, escapes : int
        Starts that live longer than `begin`, and those of them that were seen to escape.
    rate, rate_error : float
        Escapes per impact in the tail, by maximum likelihood, and its standard error.
    mean, mean_error : float
        Mean lifetime [impacts] and its standard error: as observed up to `begin`, by the
        exponential tail from there on; inf where nothing escapes.

    """

    cap: int
    starts: int
    censored: int
    begin: int
    in_tail: int
    escapes: int
    rate: float
    rate_error: float
    mean: float
    mean_error: float

    def describe(self) -> str:
        """
        Put it in words.

        Returns
        -------
        str
            A few lines.

        """
        lines = [
            f'{self.censored:,} of {self.starts:,} starts ({self.censored / self.starts:.2%}) '
            f'live {self.cap:,} impacts or longer',
            f'tail from {self.begin:,} impacts: {self.escapes:,} escapes, rate '
            f'{self.rate:.4e} +- {self.rate_error:.1e} per impact',
            f'mean lifetime: {self.mean:,.1f} +- {self.mean_error:,.1f} impacts']
        return '\n'.join(lines)


def estimate_escape(counts: npt.NDArray[np.int64], censored: int, begin: int) -> Escape:
    """
    Estimate the mean lifetime of censored transients.

    Past `begin` lifetimes are taken to be geometric, the discrete form of an exponential: of the
    impacts that are made there, each is the last with the same probability. The likelihood then
    has its maximum at escapes by impacts, whatever the censoring.

    Parameters
    ----------
    counts : ndarray of int, shape (cap + 1,)
        Starts that were seen to escape, by their lifetime [impacts].
    censored : int
        Starts that were given up at the cap.
    begin : int
        Where the tail begins [impacts], less than the cap.

    Returns
    -------
    Escape
        The estimate.

    Raises
    ------
    ValueError
        If there are no starts or the tail does not begin below the cap.

    """
    cap = len(counts) - 1
    escaped = int(np.sum(counts))
    n = escaped + censored
    if not n or not 0 <= begin < cap:
        raise ValueError(f'tail = {begin} does not lie below the cap of {cap} impacts')
    lifetimes = np.append(np.arange(cap + 1), cap)
    starts = np.append(counts, censored)
    late = lifetimes > begin
    in_tail = int(np.sum(starts[late]))
    escapes = int(np.sum(counts[late[:-1]]))
    exposure = float(np.sum(starts[late] * (lifetimes[late] - begin)))
    rate = escapes / exposure if exposure else math.nan
    error = rate * math.sqrt((1.0 - rate) / escapes) if escapes else math.nan
    body = np.minimum(lifetimes, begin).astype(np.float64)
    if in_tail == 0:
        mean, spread = _mean_and_spread(body, starts)
        mean_error = spread / math.sqrt(n)
    elif escapes == 0:
        mean, mean_error = math.inf, math.inf
    else:
        # A start counts its body and, if it gets there, a mean tail; the rate has its own error.
        each = body + late / rate
        share = in_tail / n
        mean, spread = _mean_and_spread(each, starts)
        mean_error = math.hypot(spread / math.sqrt(n), share * error / rate**2)
    return Escape(cap, n, censored, begin, in_tail, escapes, rate, error, mean,
                  mean_error)


def distribution(counts: npt.NDArray[np.int64], censored: int
                 ) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int64],
                            npt.NDArray[np.float64]]:
    """
    Count escapes in bins that are even in the logarithm.

    Parameters
    ----------
    counts : ndarray of int, shape (cap + 1,)
        Starts that were seen to escape, by their lifetime [impacts].
    censored : int
        Starts that were given up at the cap.

    Returns
    -------
    tuple of ndarray
        Edges of the bins [impacts], shape (b + 1,); escapes in (edge, next edge], shape (b,);
        share of the starts whose lifetime is longer than each edge, shape (b + 1,).

    """
    cap = len(counts) - 1
    edges = np.concatenate([[0.0], np.unique(np.round(np.geomspace(1, max(cap, 2), BINS)))])
    below = np.cumsum(counts)[np.minimum(edges, cap).astype(np.int64)]
    below[0] = 0
    return edges, np.diff(below), 1.0 - below / max(int(np.sum(counts)) + censored, 1)


def compute_lifetimes(parameters: Parameters, plane: Plane, run: cli.Run, settings: Settings,
                      begin: int | None = None) -> tuple[Store, Catalogue, Escape]:
    """
    Compute a grid of lifetimes and what follows from it into a store.

    Parameters
    ----------
    parameters : Parameters
        Of the model.
    plane : Plane
        The cells.
    run : Run
        How and where.
    settings : Settings
        What else decides.
    begin : int, optional
        Where the exponential tail begins [impacts]; a tenth of the cap by default.

    Returns
    -------
    tuple
        The store, the attractors, and the estimate.

    """
    begin = int(TAIL * settings.cap) if begin is None else begin
    if not 0 <= begin < settings.cap:
        raise ValueError(f'--tail {begin} does not lie below the cap of {settings.cap} impacts')
    store, catalogue = compute_basins(parameters, plane, run, settings, TITLE)
    escaped, censored = escapes_in(store, settings.cap)
    escape = estimate_escape(escaped, censored, begin)
    edges, counts, survival = distribution(escaped, censored)
    store.write_table({
        'edge': (('edge',), edges, {'long_name': 'edge of a bin', 'units': 'impacts'}),
        'escapes': (('bin',), counts, {
            'long_name': 'escapes after edge and up to the next', 'units': '1'}),
        'survival': (('edge',), survival, {
            'long_name': 'share of the starts with a longer lifetime', 'units': '1'}),
    })
    store.set_attributes({f'escape_{name}': value if math.isfinite(value) else str(value)
                          for name, value in dataclasses.asdict(escape).items()})
    return store, catalogue, escape


def escapes_in(store: Store, cap: int) -> tuple[npt.NDArray[np.int64], int]:
    """
    Count the lifetimes of a grid, tile by tile.

    Parameters
    ----------
    store : Store
        A finished grid.
    cap : int
        Impacts after which starts were given up.

    Returns
    -------
    tuple
        Starts that have escaped by their lifetime [impacts], shape (cap + 1,), and the number of
        those that were given up.

    """
    counts = np.zeros(cap + 1, np.int64)
    censored = 0
    for tile in range(len(store.tiles)):
        given_up = store.read(tile, 'label') == UNRESOLVED
        censored += int(np.sum(given_up))
        counts += np.bincount(store.read(tile, 'lifetime')[~given_up], minlength=cap + 1)
    return counts, censored


def _mean_and_spread(values: npt.NDArray[np.float64], counts: npt.NDArray[np.int64]
                     ) -> tuple[float, float]:
    mean = float(np.average(values, weights=counts))
    return mean, math.sqrt(float(np.average((values - mean)**2, weights=counts)))


def main(arguments: list[str] | None = None) -> int:
    """
    Run the command `lifetimes`.

    Parameters
    ----------
    arguments : list of str, optional
        Without the program's name; by default those of the process.

    Returns
    -------
    int
        Exit status: 0, 2 with one line that says why, 130 after Ctrl-C.

    """
    parser = options.Parser(
        NAME, description='Find how long every start of a grid is transient. Chaos counts as '
        'transient: only an orbit or rest ends it.')
    options.add_model(parser, alpha=1.244)
    options.add_plane(parser)
    add_settings(parser, CAP)
    parser.set_defaults(starts=STARTS, hold=HOLD)
    parser.add_argument('--tail', type=options.whole(0), metavar='N',
                        help='impacts from which lifetimes are exponential; a tenth of the cap by '
                             'default')
    parser.add_argument('--grey', action='store_true',
                        help="draw the paper's linear grey scale")

    def work(given: argparse.Namespace, run: cli.Run) -> int:
        parameters, plane = options.model_of(given), options.plane_of(given)
        store, catalogue, escape = compute_lifetimes(
            parameters, plane, run, settings_of(given, chaotic=False), given.tail)
        for each in catalogue.attractors:
            print(describe(each))
        print(escape.describe())

        def draw() -> cli.Figure:
            from .pictures import draw_lifetimes, in_words, thinned
            every = thinned(plane)
            return draw_lifetimes(
                store.read_every('lifetime', every).astype(np.int64),
                store.read_every('label', every) == UNRESOLVED, plane, escape.cap,
                f'Lifetimes, {in_words(catalogue)}, s = {plane.displacement:g}', grey=given.grey)

        def draw_beside() -> cli.Figure:
            from .pictures import draw_survival, in_words
            return draw_survival(store.read_all('edge'), store.read_all('survival'), escape.begin,
                                 escape.rate, f'Survival, {in_words(catalogue)}')

        return run.finish(draw, survival=draw_beside)

    return cli.run_tool(parser, arguments, 'lifetimes-{alpha:g}.zarr', work)
