"""Obstacles are outlined where they are."""

from __future__ import annotations

import numpy as np


def test_obstacles_are_outlined_where_they_are(draw, products, study):
    for axes in draw("obstacles", products, study).axes:
        if axes.images and axes.get_xlabel() == "x (m)":
            box, pit = axes.patches[:2]
            x, y = 0.15 * np.array([-1, 1]), 0.1 * np.array([-1, 1])
            turn = np.deg2rad(20)
            corner = [
                (
                    0.4 + a * np.cos(turn) - b * np.sin(turn),
                    11.4 + a * np.sin(turn) + b * np.cos(turn),
                )
                for a in x
                for b in y
            ]
            found = box.get_patch_transform().transform([(0, 0), (0, 1), (1, 0), (1, 1)])
            np.testing.assert_allclose(found, corner, atol=1e-9)
            assert pit.center == (-0.3, 11.4)  # type: ignore[attr-defined]
