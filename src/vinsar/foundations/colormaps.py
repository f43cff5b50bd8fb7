"""Colour maps by name: Matplotlib's own and Fabio Crameri's."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.colors import Colormap


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

    import matplotlib
    from cmcrameri import cm

    # Not by their registration with Matplotlib: whatever imported them, the answer is one.
    crameri: dict[str, Any] = {f"cmc.{short}": table for short, table in cm.cmaps.items()}
    known = crameri if name.startswith("cmc.") else matplotlib.colormaps
    if name not in known:
        near = difflib.get_close_matches(name, [*crameri, *known], n=3, cutoff=0.5)
        hint = f"did you mean {' or '.join(dict.fromkeys(near))}?" if near else ""
        raise ValueError(f"there is no colour map '{name}'; {hint or 'try cmc.batlow or viridis'}")
    found: Colormap = known[name]
    return found
