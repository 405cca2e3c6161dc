"""The few small messages that a bag is checked by, in the bytes of plain CDR."""

from collections.abc import Mapping
import dataclasses
import struct
from typing import Any, Final

_HEAD: Final = 4


class _Reader:
    """Goes through a serialized message; alignments count from behind its head."""

    def __init__(self, cdr: bytes) -> None:
        if len(cdr) < _HEAD or cdr[0] != 0 or cdr[1] > 1:
            raise ValueError('message is not in plain CDR')
        self._cdr = cdr
        self._order = '<' if cdr[1] else '>'
        self._place = _HEAD

    def take(self, code: str, count: int = 1) -> tuple[Any, ...]:
        size = struct.calcsize(code)
        self._place += (_HEAD - self._place) % size
        if count < 0 or self._place + size * count > len(self._cdr):
            raise ValueError(f'message of {len(self._cdr)} bytes is cut off')
        values = struct.unpack_from(f'{self._order}{count}{code}', self._cdr, self._place)
        self._place += size * count
        return values

    def length(self) -> int:
        return int(self.take('I')[0])

    def text(self) -> str:
        size = self.length()
        if self._place + size > len(self._cdr):
            raise ValueError(f'message of {len(self._cdr)} bytes is cut off')
        text = self._cdr[self._place:self._place + max(size - 1, 0)]
        self._place += size
        return bytes(text).decode('utf-8', 'replace')

    def header(self) -> int:
        seconds, = self.take('i')
        nanoseconds, = self.take('I')
        self.text()
        return int(seconds) * 1_000_000_000 + int(nanoseconds)


@dataclasses.dataclass(frozen=True)
class Named:
    """
    A stamp with named values.

    Attributes
    ----------
    stamp : int
        Time of the header [ns].
    values : mapping
        Numbers of a JointState by name; texts of a status by key.
    name : str
        Of the status; empty for a JointState.

    """

    stamp: int
    values: Mapping[str, Any]
    name: str = ''


def read_joint_state(cdr: bytes) -> Named:
    """
    Return the positions of a sensor_msgs/JointState.

    Parameters
    ----------
    cdr : bytes
        The message.

    Returns
    -------
    Named
        Floats by name.

    Raises
    ------
    ValueError
        If the bytes are no JointState, or names and positions do not go together.

    """
    reader = _Reader(cdr)
    stamp = reader.header()
    names = [reader.text() for _ in range(reader.length())]
    positions = reader.take('d', reader.length())
    if len(names) != len(positions):
        raise ValueError(f'joint state has {len(names)} names and {len(positions)} positions')
    return Named(stamp, dict(zip(names, positions, strict=True)))


def read_diagnostics(cdr: bytes) -> list[Named]:
    """
    Return the statuses of a diagnostic_msgs/DiagnosticArray.

    Parameters
    ----------
    cdr : bytes
        The message.

    Returns
    -------
    list of Named
        Texts by key.

    Raises
    ------
    ValueError
        If the bytes are no DiagnosticArray.

    """
    reader = _Reader(cdr)
    stamp = reader.header()
    found = []
    for _ in range(reader.length()):
        reader.take('B')
        name, _, _ = reader.text(), reader.text(), reader.text()
        values = {}
        for _ in range(reader.length()):
            key = reader.text()
            values[key] = reader.text()
        found.append(Named(stamp, values, name))
    return found
