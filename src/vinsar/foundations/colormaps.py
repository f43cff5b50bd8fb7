"""Colour maps by name: Matplotlib's own and Fabio Crameri's."""

from __future__ import annotations

import importlib.util
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from matplotlib.colors import Colormap
    from numpy.typing import NDArray

_PREFIX, _REVERSED, _CATEGORICAL = "cmc.", "_r", "S"


def find(name: str) -> Colormap:
    """Return a colour map.

    Parameters
    ----------
    name
        A map of Fabio Crameri's collection as ``cmc.<name>``, or one of Matplotlib's own.

    Returns
    -------
    matplotlib.colors.Colormap
        The map.

    Raises
    ------
    ValueError
        If there is no such map; names the nearest known names.
    """
    import difflib

    if (table := _crameri().get(name)) is not None:
        return _read(table, reverse=name.endswith(_REVERSED))
    import matplotlib

    # Not by their registration with Matplotlib: whatever imported them, the answer is one.
    known = () if name.startswith(_PREFIX) else matplotlib.colormaps
    if name not in known:
        near = difflib.get_close_matches(name, [*_crameri(), *known], n=3, cutoff=0.5)
        hint = f"did you mean {' or '.join(dict.fromkeys(near))}?" if near else ""
        raise ValueError(f"there is no colour map '{name}'; {hint or 'try cmc.batlow or viridis'}")
    return matplotlib.colormaps[name]


@cache
def _crameri() -> dict[str, Path]:
    """Return the tables of Fabio Crameri's maps by name.

    They are read here because the package's own module loads pyplot and every table, which takes
    longer than all else that a start waits for.
    """
    place = importlib.util.find_spec("cmcrameri")
    if place is None or not place.submodule_search_locations:
        raise ImportError("the package cmcrameri is not installed")
    found = {}
    for table in sorted(Path(place.submodule_search_locations[0], "cmaps").glob("*.txt")):
        found[f"{_PREFIX}{table.stem}"] = table
        if not table.stem.endswith(_CATEGORICAL):
            found[f"{_PREFIX}{table.stem}{_REVERSED}"] = table
    return found


def _read(table: Path, *, reverse: bool) -> Colormap:
    from matplotlib.colors import ListedColormap

    found = ListedColormap(_colours(table), name=table.stem)
    return found.reversed() if reverse else found


@cache
def _colours(table: Path) -> NDArray[np.floating]:
    return np.loadtxt(table)
