"""What the design sheet predicts, against imaged point targets and a simulated scene."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from vinsar.prediction import design
from vinsar.processing import focusing
from vinsar.radar import aperture, trajectory, waveform
from vinsar.simulation import echo
from vinsar.study import pipeline, validation

CONFIG = Path(__file__).parents[2] / "config"
FREQUENCY = waveform.frequencies(13e9, 15e9, 201)
WAVELENGTH = 299_792_458.0 / 14e9


@pytest.mark.parametrize(("axis", "offset_m"), [(1, 1e-3), (2, 2e-3)])
@pytest.mark.parametrize(("x", "y"), [(0.0, 13.0), (2.0, 10.0)])
def test_a_displaced_antenna_moves_the_height_of_a_point_target_as_predicted(
    rail, scatterers, axis, offset_m, x, y
):
    told = rail.copy(deep=True)
    for end in ("transmitter", "receiver"):
        told[end].values[1, :, axis] += offset_m
    pixel = np.array([x]), np.array([y])
    near, far = trajectory.range_extent(rail, *pixel)
    profiles = focusing.compress(
        echo.simulate(scatterers([x, y, 0.0]), rail, frequency=FREQUENCY, accuracy_db=None),
        near_range_m=near - 0.5,
        far_range_m=far + 0.5,
    )
    images = focusing.backproject(profiles, told, x=pixel[0], y=pixel[1])["image"].values[:, 0, 0]
    lower, upper = trajectory.apertures(told)
    flat = aperture.flat_earth_phase(lower, upper, x, y, WAVELENGTH)
    phase = flat + np.angle(images[0] * images[1].conj())
    *_, height = aperture.locate(lower, upper, x, y, phase, WAVELENGTH)
    sheet = design.Sheet(validation.load(CONFIG / "paper.yaml"))
    expected = offset_m * float(sheet.height_per_offset(x, y, np.eye(3)[axis]))
    # Interpolation errs by 1e-3 of the amplitude, a milliradian: 0.1 mm; the second order of the
    # offset is offset / B of the error.
    assert float(height) == pytest.approx(expected, abs=3e-4, rel=0.02)


def run(**changes):
    """A small scene of gentle relief, without shadow."""
    raw = validation.merge(
        validation.load(CONFIG / "paper.yaml", CONFIG / "smoke.yaml").model_dump(mode="json"),
        {
            "variants": {},
            "sweeps": {},
            "scene": {"peak_height_m": 0.05},
            "radar": {"position_spacing_m": 0.01},
            "echo": {"accuracy_db": -85.0},
        },
    )
    study = validation.check(validation.merge(raw, changes))
    return design.Sheet(study), pipeline.run(study, only="accuracy")


@pytest.mark.parametrize("changes", [{}, {"echo": {"snr_db": 10.0}}])
def test_the_predicted_height_noise_is_measured_within_a_factor_of_two_and_a_half(changes):
    sheet, products = run(**changes)
    accuracy = products["accuracy"].sel(region="visible_ground")
    ratio = 1.4826 * float(accuracy["mad"]) / sheet.scene_height_std()
    # The phase filter averages over more than the window whose looks the prediction counts.
    assert 1 / 2.5 < ratio < 2.5


def test_position_errors_leave_the_predicted_coherence():
    level = 0.05
    motion = {"axis": "y", "channels": "independent", "level_wavelengths": level}
    sheet, products = run(motion=motion)
    y = sheet.places
    errors = level * sheet.instrument.wavelength * sheet.phase_per_position(0.0, y, 1)
    predicted = float(np.mean(sheet.coherence(y, errors)))
    measured = float(np.median(products["interferogram"]["coherence"].values))
    # 81 draws make the focused share uncertain by sqrt(2 / 81) of the variance 0.37 of the phase;
    # few looks bias the coherence upwards by about (1 - g^2) / 2 N.
    assert measured == pytest.approx(predicted, abs=0.1)
    assert predicted < 0.9
