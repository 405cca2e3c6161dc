"""The labels of a grid by a peer and by the lanes, and who is right where they differ."""

import dataclasses
import os
from pathlib import Path
import random
import subprocess
import sys
import time

import numpy as np

from gear_rattle_ros.attractors.catalogue import Catalogue
from gear_rattle_ros.attractors.finding import find_attractors
from gear_rattle_ros.attractors.plane import Plane
from gear_rattle_ros.core.model import Parameters

from .arbiter import label_of

FOLLOW = Path(__file__).with_name('follow.py')
PARAMETERS = Parameters(alpha=0.48)
# Distance within which the last impact of a peer is on an orbit [1].
NEAR = 0.02
CAP = 20_000


@dataclasses.dataclass(frozen=True)
class Comparison:
    """Both grids of labels, and the seconds of computing them."""

    ours: np.ndarray
    theirs: np.ndarray
    our_seconds: float
    their_seconds: float
    lifetimes: np.ndarray
    initial: np.ndarray
    catalogue: Catalogue

    def classes(self) -> dict[str, np.ndarray]:
        """Divide the cells by the label that the peer gives them."""
        agrees = self.ours == self.theirs
        return {'the same label': agrees, 'another label': ~agrees & (self.theirs >= 0),
                'no label': self.theirs < 0}


def python_of(peer: str) -> str:
    """Return the interpreter that has the peer, or an empty string."""
    python = (os.environ.get('HEYOKA_PYTHON') if peer == 'heyoka' else None) or sys.executable
    missing = subprocess.run([python, '-c', f'import {peer}'], capture_output=True).returncode
    return '' if missing else python


def compare(peer: str, python: str, size: int, count: int, folder: Path) -> Comparison:
    """Follow size x size cells by the peer, count impacts each, and by the lanes."""
    plane = Plane(phases=size, velocities=size)
    initial = plane.cells(PARAMETERS, slice(0, size), slice(0, size))
    np.save(folder / 'initial.npy', np.stack([initial['phase'], initial['velocity']], axis=1))
    done = subprocess.run(
        [python, str(FOLLOW), peer, str(folder / 'initial.npy'), str(folder / 'last.npy'),
         str(count)], check=True, stdout=subprocess.PIPE, text=True)
    last = np.load(folder / 'last.npy')
    catalogue = find_attractors(PARAMETERS, plane.draw(PARAMETERS, 1000, 1))
    begin = time.perf_counter()
    result = catalogue.label(initial, CAP)
    seconds = time.perf_counter() - begin
    theirs = np.full(len(initial), -1)
    for number, orbit in enumerate(catalogue.orbits):
        for phase, velocity in zip(orbit.phases, orbit.velocities, strict=True):
            near = (np.abs(np.sin(0.5 * (last[:, 0] - phase))) < 0.5 * NEAR) & (
                np.abs(last[:, 1] - velocity) < NEAR)
            theirs[near] = number
    return Comparison(result['label'], theirs, seconds, float(done.stdout), result['lifetime'],
                      initial, catalogue)


def decide(found: Comparison, chosen: np.ndarray, most: int) -> tuple[int, int, int]:
    """Follow some of the chosen cells in 50 digits; how many, right here, right there."""
    orbits = [list(zip(orbit.phases.tolist(), orbit.velocities.tolist(), strict=True))
              for orbit in found.catalogue.orbits]
    cells = np.flatnonzero(chosen).tolist()
    sample = random.Random(1).sample(cells, min(most, len(cells)))
    right = [label_of(found.initial['phase'][n], found.initial['velocity'][n], orbits)
             for n in sample]
    return (len(sample), *(sum(labels[n] == label for n, label in zip(sample, right, strict=True))
                           for labels in (found.ours, found.theirs)))
