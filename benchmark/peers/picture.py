"""Where peers give other labels: here, there, and the cells that differ."""

from pathlib import Path

from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
import numpy as np

from gear_rattle_ros.palette import hue

# No label, the first orbit, the second.
COLOURS = ListedColormap(['#d0d0d0', hue(0), hue(1)])
DIFFERS = ListedColormap(['#ffffff', '#c2410c'])


def draw(grids: dict[str, tuple[np.ndarray, np.ndarray]], path: Path) -> None:
    """Draw a row of three pictures for each peer."""
    if not grids:
        return
    figure = Figure((10.5, 3.4 * len(grids)), dpi=80, layout='constrained')
    rows = figure.subplots(len(grids), 3, squeeze=False, sharex=True, sharey=True)
    window = {'extent': (0.0, 2.0, -2.0, 2.0), 'origin': 'lower', 'aspect': 'auto',
              'interpolation': 'nearest'}
    for axes, (peer, (ours, theirs)) in zip(rows, grids.items(), strict=True):
        for one, labels, words in ((axes[0], ours, 'basins'), (axes[1], theirs, peer)):
            one.imshow(labels, cmap=COLOURS, vmin=-1.5, vmax=1.5, **window)
            one.set_title(words)
        differs = ours != theirs
        axes[2].imshow(differs, cmap=DIFFERS, vmin=0, vmax=1, **window)
        axes[2].set_title(f'{np.mean(differs):.1%} differ')
        axes[0].set_ylabel("velocity s' [1]")
    for one in rows[-1]:
        one.set_xticks([0.0, 0.5, 1.0, 1.5, 2.0], ['0', 'π/2', 'π', '3π/2', '2π'])
        one.set_xlabel('drive phase [rad]')
    figure.savefig(path)
