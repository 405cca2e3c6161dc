"""Verify a bag from itself: rebuild every flight and find each record again, bit for bit."""

from collections.abc import Callable
import dataclasses
from pathlib import Path
import time

from .plain import attempt, Parser
from .recomputed import Exponents, Transients
from ..bags import Bag, CloudDecoder
from ..bags.small_messages import Named, read_diagnostics, read_joint_state
from ..core.fingerprint import fingerprint
from ..core.succession import Hole, Succession


@dataclasses.dataclass(frozen=True)
class Verdict:
    """
    What a bag has proved to be.

    Attributes
    ----------
    events, impacts, kicked, flights, epochs, runs : int
        Seen; kicked by noise; rebuilt from one record to the next; seen.
    exponents, transients : int
        Estimates and reports that were found again, bit for bit.
    beyond : int
        Estimates and reports that rest on events which are not in the bag.
    holes : tuple of Hole
        Where records are missing.
    fault : str
        The first record or report that does not follow from the events before it, or empty.
    kernels : frozenset of str
        Fingerprints of the kernels that the simulators of the bag have told.
    is_whole : bool
        Whether the bag was closed properly.
    seconds : float
        What verifying it took [s].

    """

    events: int
    impacts: int
    kicked: int
    flights: int
    epochs: int
    runs: int
    exponents: int
    transients: int
    beyond: int
    holes: tuple[Hole, ...]
    fault: str
    kernels: frozenset[str]
    is_whole: bool
    seconds: float

    @property
    def is_verified(self) -> bool:
        """Whether there are events, all follow, and none is missing between them."""
        return bool(self.events) and not self.fault and not self.holes

    def describe(self) -> str:
        """
        Put the verdict in words.

        Returns
        -------
        str
            One line; a line more for every hole.

        """
        seen = (f'{self.events} events ({self.impacts} impacts, {self.kicked} of them kicked by '
                f'noise), {self.flights} flights rebuilt, {self.epochs} epochs in '
                f'{self.runs} runs')
        again = f'{self.exponents} estimates and {self.transients} transient reports found again'
        notes = ''
        if self.beyond:
            notes += f', {self.beyond} more rest on what is not in the bag'
        if not self.is_whole:
            notes += '; the bag was not closed properly'
        end = f'{self.seconds:.2f} s ({self.events / max(self.seconds, 1e-9):.2g} events/s)'
        if self.is_verified:
            return f'verified: {seen}, {again}{notes}; {end}'
        if self.fault:
            return f'not verified: {self.fault}{self._other_kernels()}'
        if not self.events:
            return 'not verified: there are no events'
        lines = [f'not verified: {len(self.holes)} holes, what is between them follows: {seen}, '
                 f'{again}{notes}; {end}']
        return '\n'.join([*lines, *(f'  {hole.describe()}' for hole in self.holes)])

    def _other_kernels(self) -> str:
        here = fingerprint()
        if not self.kernels:
            return f'; the bag does not say which kernels recorded it (these are {here})'
        others = sorted(self.kernels - {here})
        if others:
            return (f'; it was recorded with other kernels ({", ".join(others)}) than these '
                    f'({here}): verify it with the version that recorded it')
        return ''


def verify(path: Path, topic: str = '') -> Verdict:
    """
    Verify a bag.

    Parameters
    ----------
    path : Path
        A bag directory or an .mcap file.
    topic : str
        Of the events; without it, the one whose last part is ``impacts``. The exponents and
        transients are those beside it.

    Returns
    -------
    Verdict
        What came out.

    Raises
    ------
    BagError
        If the bag cannot be read, or there is no such topic.

    """
    began = time.monotonic()
    bag = Bag(path)
    impacts = bag.find_impacts(topic)
    beside = impacts.rpartition('/')[0]
    exponents = Exponents(_read(bag, f'{beside}/lyapunov', lambda data: [read_joint_state(data)]))
    transients = Transients(_read(bag, f'{beside}/transient', read_diagnostics))
    kernels = {status.values['kernels'] for status in _read(bag, '/diagnostics', read_diagnostics)
               if 'kernels' in status.values}
    succession = Succession()
    decoder = CloudDecoder()
    fault = ''
    before: int | None = None
    for number, message in enumerate(bag.messages([impacts])):
        where = f'message {number} of {impacts}'
        try:
            stamp = decoder.parse(message.data).stamp
            events = decoder.events(message.data)
        except ValueError as error:
            fault = f'{where}: {error}'
            break
        if not len(events):
            continue
        discontinuities = (len(succession.holes), succession.runs)
        wrong = succession.take(events)
        if wrong is not None:
            place = f'record {wrong.place} of {where}' if wrong.place >= 0 else \
                f'the last record before {where}'
            fault = f'{place}, impact {wrong.index}, epoch {wrong.epoch}: {wrong.what}'
            break
        if before is not None and stamp != before:
            transients.end_stamp(before)
        before = stamp
        is_first = discontinuities != (len(succession.holes), succession.runs)
        exponents.take(events, stamp, is_first)
        transients.take(events, stamp, is_first)
        if exponents.tally.fault or transients.tally.fault:
            break
    if before is not None and not fault:
        transients.end_stamp(before)
    tallies = exponents.finish(), transients.finish()
    return Verdict(
        succession.events, succession.impacts, succession.kicked, succession.flights,
        succession.epochs, succession.runs, tallies[0].found, tallies[1].found,
        sum(tally.beyond for tally in tallies), tuple(succession.holes),
        fault or tallies[0].fault or tallies[1].fault, frozenset(kernels), bag.is_whole,
        time.monotonic() - began)


def main(arguments: list[str] | None = None) -> int:
    """
    Verify bags.

    Parameters
    ----------
    arguments : list of str, optional
        Without the program's name; by default those of the process.

    Returns
    -------
    int
        Exit status: 0 if all are verified, 1 if one is not, 2 if one cannot be read.

    """
    parser = Parser(prog='verify', description=(
        'Rebuild every flight of a recorded run from the bag alone, find each event again bit for '
        'bit, and recompute the exponents and transients that were recorded live.'))
    parser.add_argument('bags', nargs='+', metavar='BAG', type=Path,
                        help='bag directory or .mcap file')
    parser.add_argument('--topic', default='', help='of the events; default: the only .../impacts')
    given = parser.parse_args(arguments)

    def one(path: Path) -> int:
        verdict = verify(path, given.topic)
        print(f'{path}: {verdict.describe()}', flush=True)
        return 0 if verdict.is_verified else 1

    return max(attempt('verify', lambda path=path: one(path)) for path in given.bags)


def _read(bag: Bag, name: str, decode: Callable[[bytes], list[Named]]) -> list[Named]:
    if name not in bag.topics:
        return []
    found = []
    for message in bag.messages([name]):
        try:
            found += decode(message.data)
        except ValueError:
            # Of another type under the same name: nothing that can be recomputed.
            continue
    return found
