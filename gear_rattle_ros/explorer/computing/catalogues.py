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

"""The attractors at every parameter of a view: from a quick search, then a thorough one."""

from collections import OrderedDict
from collections.abc import Callable
import dataclasses
import threading
from typing import Final

import numpy as np

from ..view import BASINS, DRAWN, HOLD, LIFETIMES, View
from ...attractors.catalogue import Catalogue
from ...attractors.finding import find_attractors
from ...core.many.settling import UNSETTLED

# Initial conditions of the quick search, and the impacts for which they are followed.
QUICK_DRAWN: Final = 200
QUICK_HOLD: Final = 2_000
SEED: Final = 1
# Number of parameters whose attractors are remembered.
KEPT: Final = 256
# Interval at which a caller that waits for a search checks whether it is still wanted [s].
GLANCE: Final = 0.02

Key = tuple[View, bool]


class GivenUp(Exception):
    """Something else is wanted, or nothing at all."""


@dataclasses.dataclass(frozen=True)
class Known:
    """The result of a search; complete where a thorough search would find no more."""

    catalogue: Catalogue
    is_complete: bool = True


class Catalogues:
    """Searches, remembered by parameters and plane; shared by all pages."""

    def __init__(self) -> None:
        self._known: OrderedDict[Key, Known] = OrderedDict()
        self._lock = threading.Lock()
        self._searching = threading.Lock()

    def quick(self, view: View) -> Known:
        """Return the result of a quick search; chaotic attractors only where already known."""
        known = self._get(_key(view))
        if known is None:
            found = find_attractors(view.parameters, _random(view, QUICK_DRAWN), hold=QUICK_HOLD,
                                    chaotic=False)
            # What has not settled after a last look is nearly always chaos or a long transient.
            known = self._put(_key(view), Known(found, not np.any(found.labels == UNSETTLED)))
        return known

    def complete(self, view: View, check: Callable[[], None]) -> Known:
        """Return the result of a thorough search; `check` is called often, to abandon it."""
        # It finds chaotic attractors, too, unless the view is of lifetimes: there chaos must end.
        key = _key(view)
        known = self._get(key)
        while known is None or not known.is_complete:
            check()
            if self._searching.acquire(timeout=GLANCE):
                given_up = threading.Event()
                thread = threading.Thread(
                    target=self._search, args=(key, view, given_up), daemon=True)
                thread.start()
                try:
                    while thread.is_alive():
                        thread.join(GLANCE)
                        check()
                except BaseException:
                    given_up.set()
                    raise
            known = self._get(key)
        return known

    def add(self, view: View, catalogue: Catalogue) -> None:
        """Remember the orbits of a catalogue that no random initial condition has reached."""
        known = self.quick(view)
        self._put(_key(view), dataclasses.replace(
            known, catalogue=known.catalogue.with_orbits(catalogue.late)))

    def _search(self, key: Key, view: View, given_up: threading.Event) -> None:
        def check() -> None:
            if given_up.is_set():
                raise GivenUp

        try:
            found = find_attractors(view.parameters, _random(view, DRAWN), hold=HOLD,
                                    chaotic=view.kind != LIFETIMES, check=check)
            self._put(key, Known(found))
        except GivenUp:
            pass
        finally:
            self._searching.release()

    def _get(self, key: Key) -> Known | None:
        with self._lock:
            if key in self._known:
                self._known.move_to_end(key)
            return self._known.get(key)

    def _put(self, key: Key, known: Known) -> Known:
        with self._lock:
            self._known[key] = known
            self._known.move_to_end(key)
            while len(self._known) > KEPT:
                self._known.popitem(last=False)
        return known


def _key(view: View) -> Key:
    return view.whole(BASINS), view.kind == LIFETIMES


def _random(view: View, count: int) -> np.ndarray:
    # From the whole plane, so that panning and zooming do not change what is known.
    return view.plane(1).whole().draw(view.parameters, count, SEED)
