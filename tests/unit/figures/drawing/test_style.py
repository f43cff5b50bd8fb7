"""The look of the figures."""

from __future__ import annotations

import pytest

from vinsar import figures


def test_colormaps_are_found_by_either_collection():
    assert figures.colormap("cmc.romaO").name == "romaO"
    assert figures.colormap("viridis").name == "viridis"
    with pytest.raises(ValueError, match="no colour map 'batlow nonsense'"):
        figures.colormap("batlow nonsense")
