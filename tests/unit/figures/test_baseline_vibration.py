"""The length of the baseline under position errors: both maps hold the sweep."""

from __future__ import annotations

import numpy as np
import pytest


def test_heat_maps_hold_the_sweep_on_one_scale(draw, written, products, study):
    figure = draw("baseline_vibration", products, study)
    std = 100 * products["sweeps/baseline_vibration"]["std"].sel(region="whole_scene")
    meshes = [axes.collections[0] for axes in figure.axes[:2]]
    for mesh, mode in zip(meshes, ("common", "independent"), strict=True):
        part = std.sel(motion_channels=mode).mean("realization")
        np.testing.assert_allclose(mesh.get_array(), part)
    assert meshes[0].get_clim() == meshes[1].get_clim()
    assert meshes[0].get_clim()[0] == pytest.approx(float(std.mean("realization").min()))
    labels = [label.get_text() for label in figure.axes[0].get_yticklabels()]
    assert labels == ["0.1", "0.2", "0.3", "0.5", "0.7", "1"]
    texts = written(figure)
    for level in (3, 5, 10, 20):
        assert f"{level} cm" in texts
