"""Maps: marks of phases, and the outline of the shadow."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from vinsar.figures.drawing import maps, style


@pytest.mark.parametrize(
    ("limits", "most", "halves"),
    [
        ((-np.pi, np.pi), 7, [-2, 0, 2]),
        ((-1.5 * np.pi, 1.5 * np.pi), 7, [-2, 0, 2]),
        ((-0.5 * np.pi, 0.5 * np.pi), 7, [-1, 0, 1]),
        ((0, 20 * np.pi), 7, [0, 8, 16, 24, 32, 40]),
    ],
)
def test_pi_ticks_are_round_and_few(limits, most, halves):
    assert maps.pi_ticks(limits, most) == halves


def test_pi_labels():
    labels = [maps.pi_label(n) for n in (-4, -3, -2, -1, 0, 1, 2, 3, 8)]
    assert labels == ["−2π", "−3π/2", "−π", "−π/2", "0", "π/2", "π", "3π/2", "4π"]


def test_shadow_s_outline_follows_patches_and_drops_single_cells():

    axis = np.arange(40) * 0.05
    mask = np.zeros((40, 40), dtype=bool)
    mask[5, 5] = True
    single = xr.DataArray(mask.copy(), {"y": axis, "x": axis}, ("y", "x"))
    axes = style.place(style.new_figure(50, 50), 5, 5, 40, 40)
    assert not maps.outline_shadow(axes, single)
    assert not axes.collections
    mask[20:30, 10:30] = True
    patch = single.copy(data=mask)
    assert maps.outline_shadow(axes, patch)
    (path,) = axes.collections[0].get_paths()
    x, y = path.vertices.T
    assert (x.min(), x.max()) == pytest.approx((axis[10] - 0.025, axis[29] + 0.025), abs=0.005)
    assert (y.min(), y.max()) == pytest.approx((axis[20] - 0.025, axis[29] + 0.025), abs=0.005)
