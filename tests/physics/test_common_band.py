"""Ground that slopes decorrelates two channels by the band that they do not share."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from vinsar.processing import common_band
from vinsar.radar import trajectory, waveform
from vinsar.simulation import echo

FREQUENCY = waveform.frequencies(13e9, 15e9, 101)
X, Y = np.linspace(-1.5, 1.5, 61), np.linspace(9.0, 11.0, 51)


@pytest.mark.parametrize("slope", [0.0, 0.5, -0.5])
def test_slopes_are_coherent_in_the_band_that_both_channels_share(rail, scatterers, slope):
    """Two bands that overlap by a share s are coherent by s (Gatelli et al. 1994)."""
    rng = np.random.default_rng(5)
    x, y = rng.uniform([-2.2, 8.2], [2.2, 11.8], (20_000, 2)).T
    ground = scatterers(np.stack([x, y, slope * (y - 10)], axis=-1), rng.random(x.size))
    signal = echo.simulate(ground, rail, frequency=FREQUENCY, accuracy_db=-80)
    grid_y, grid_x = np.meshgrid(Y, X, indexing="ij")
    point = np.stack([grid_x, grid_y, slope * (grid_y - 10)])
    common = common_band.support(tuple(trajectory.apertures(rail)), point, FREQUENCY, 81)
    whole = dataclasses.replace(
        common,
        bands=np.array([[[12e9, 16e9]]] * 2),
        kind=np.zeros_like(common.kind),
        first=np.full_like(common.first, -0.5),
        last=np.full_like(common.last, 80.5),
    )

    def coherence(kept):
        lower, upper = common_band.focus(signal, rail, point, kept)
        power = (abs(lower) ** 2).sum() * (abs(upper) ** 2).sum()
        return (lower * np.conj(upper)).sum() / np.sqrt(power)

    share = common.share(FREQUENCY, 81).mean()
    # Some 300 resolution cells: the sample coherence scatters by (1 - share^2) / sqrt(600).
    assert abs(coherence(whole)) == pytest.approx(share, abs=4 * (1 - share**2) / np.sqrt(600))
    # What is left: sub-bands up to half a hundredth off, and the paths' curvature.
    assert coherence(common).real > 0.985
