"""The attitude of the baseline: drawn errors against the formulas."""

from __future__ import annotations

import numpy as np

from vinsar.evaluation import baseline_errors


def test_baseline_angle_shows_draws_and_formulas(draw, lines_of, products, study):
    figure = draw("baseline_angle", products, study)
    product = products["baseline_angle"]
    first, second = (lines_of(axes) for axes in figure.axes)
    shown = {
        "length_drawn": first["drawn, exact inversion"],
        "length_eq5": first["Eq. 5"],
        "length_exact": first["exact derivative"],
        "angle_drawn": second["drawn, exact inversion"],
        "angle_eq12": second["Eq. 12"],
    }
    for name, line in shown.items():
        np.testing.assert_allclose(line.get_ydata(), 1000 * product[name], err_msg=name)
        np.testing.assert_allclose(line.get_xdata(), baseline_errors.ANGLES_DEG)
