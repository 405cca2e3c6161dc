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

"""What all commands have in common: refusals in one line, exit statuses, numbers below zero."""

import argparse
from collections.abc import Callable
import re
import sys
from typing import Any, Final, NoReturn

from ..places import program

INTERRUPTED: Final = 130


class Parser(argparse.ArgumentParser):
    """Options of a tool; refuses with one line, and takes ``-1e-3`` and ``-pi`` for numbers."""

    def __init__(self, name: str, **settings: Any) -> None:
        super().__init__(program(name), **settings)
        self._name = name
        self._negative_number_matcher = re.compile(r'^-[\d.p]')

    def error(self, message: str) -> NoReturn:
        self.exit(2, f'{self._name}: {message}\n')


def attempt(name: str, action: Callable[[], int]) -> int:
    """Run a command; exit status 2 after one line that names what is wrong, 130 after Ctrl-C."""
    try:
        return action()
    except KeyboardInterrupt:
        print(f'{name}: interrupted', file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        raise
    except OSError as error:
        message = f'{error.filename}: {error.strerror}' if error.filename else str(error)
    except (MemoryError, ValueError) as error:
        message = str(error) or 'not enough memory'
    print(f'{name}: {message}', file=sys.stderr)
    return 2
