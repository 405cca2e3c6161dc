"""What the small commands on bags have in common."""

import argparse
from collections.abc import Callable
import sys
from typing import Final, NoReturn

from ..bags import BagError

INTERRUPTED: Final = 130


class Parser(argparse.ArgumentParser):
    """An argument parser that says in one line what is wrong; exit status 2."""

    def error(self, message: str) -> NoReturn:
        """
        End the process.

        Parameters
        ----------
        message : str
            What is wrong.

        """
        self.exit(2, f'{self.prog}: {message}\n')


def attempt(name: str, action: Callable[[], int]) -> int:
    """
    Run a command, with one line where it cannot do its work.

    Parameters
    ----------
    name : str
        Of the command.
    action : callable
        Returns an exit status.

    Returns
    -------
    int
        That, or 2 for a bag that cannot be read or written, 130 after Ctrl-C.

    """
    try:
        return action()
    except (BagError, OSError) as error:
        print(f'{name}: {error}', file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print(f'{name}: interrupted', file=sys.stderr)
        return INTERRUPTED
