"""What a radar can do: against formulas of the rail, slow sums, and every place that shows it."""

from __future__ import annotations

import numpy as np
import pytest

import vinsar
from vinsar.figures import acquisition
from vinsar.prediction import design
from vinsar.radar import formulas, geometry, instrument
from vinsar.radar.instrument import Instrument
from vinsar.report import content
from vinsar.study import validation

LIGHT = 299_792_458.0
WAVELENGTH = LIGHT / 14e9
STUDY = vinsar.load()
SYSTEMS = ("rail", "transmit_pair", "receive_pair")


def planned(**changes):
    return Instrument.planned(STUDY.radar.model_copy(update=changes))


def test_the_waveform_of_the_paper():
    radar = planned()
    assert radar.wavelength == pytest.approx(WAVELENGTH)
    assert radar.shortest_wavelength == pytest.approx(LIGHT / 15e9)
    assert radar.range_resolution == pytest.approx(LIGHT / 4e9)
    assert radar.frequency_step == pytest.approx(5e6)
    assert radar.unambiguous_range == pytest.approx(LIGHT / 1e7)
    assert radar.positions == 81
    assert radar.lowest == 2.0


@pytest.mark.parametrize("system", SYSTEMS)
def test_the_baseline_is_that_of_the_antennas_which_it_separates(system):
    radar = planned(system=system, baseline_angle_deg=60.0)
    lower, upper = radar.separated
    assert radar.baseline == pytest.approx(0.3)
    np.testing.assert_allclose(upper - lower, 0.3 * np.array([0, 0.5, np.sqrt(0.75)]), atol=1e-12)


def speckled(radar, y, draws=3000, seed=0):
    """Return the coherence of level ground by a sum over its scatterers, in the plane x = 0."""
    rng = np.random.default_rng(seed)
    # Beyond the cell's sidelobes nothing correlates; a scatterer a quarter of a cell.
    ahead = y + np.arange(-3.0, 3.0, 0.02)
    wavenumber = 2 * np.pi * radar.frequency[:: len(radar.frequency) // 60] / LIGHT
    response = []
    for part in (radar.lower, radar.upper):
        path = sum(
            geometry.slant_range(end, 0.0, ahead) - geometry.slant_range(end, 0.0, y)
            for end in (part.transmitter, part.receiver)
        )
        response.append(np.exp(1j * wavenumber[:, None] * path).mean(axis=0))
    scatterers = rng.standard_normal((draws, ahead.size, 2)) @ np.array([1, 1j])
    first, second = (scatterers @ weight for weight in response)
    power = np.vdot(first, first).real * np.vdot(second, second).real
    return abs(np.vdot(first, second)) / np.sqrt(power)


@pytest.mark.parametrize("system", SYSTEMS)
@pytest.mark.parametrize("length", [0.3, 1.0, 3.0])
def test_level_ground_is_as_coherent_as_its_scatterers_make_it(system, length):
    radar = planned(system=system, baseline_m=length)
    found = speckled(radar, 10.5)
    # 3000 draws: (1 - g^2) / sqrt(2 N) = 0.011 at most, and a bias of 1 / (2 N g).
    assert radar.geometric_coherence(0.0, 10.5) == pytest.approx(found, abs=0.035)
    if length == 3.0 and system == "rail":
        # The plane wave is far off where the baseline is as long as the antennas are high.
        slant, look = radar.slant_range(0.0, 10.5), radar.look_angle(0.0, 10.5)
        _, across = formulas.baseline_components(length, np.pi / 2, look)
        critical = formulas.critical_baseline(slant, WAVELENGTH, look, radar.range_resolution)
        assert 1 - across / critical > found + 0.15


@pytest.mark.parametrize("system", SYSTEMS)
@pytest.mark.parametrize("angle", [0.0, 60.0, 90.0])
def test_at_the_critical_baseline_coherence_is_lost_and_just_below_not_yet(system, angle):
    radar = planned(system=system, baseline_angle_deg=angle)
    y = np.array([10.0, 13.0])
    for at, length in zip(y, radar.critical_baseline(0.0, y), strict=True):
        if np.isinf(length):
            assert system != "rail"
            continue
        for factor, lost in ((1.001, True), (0.97, False)):
            longer = planned(
                system=system, baseline_angle_deg=angle, baseline_m=factor * float(length)
            )
            assert (float(longer.geometric_coherence(0.0, at)) == 0) == lost
    # Half way there, half of the coherence is left, or less: ranges grow faster than baselines.
    if system == "rail":
        length = float(radar.critical_baseline(0.0, 13.0))
        assert speckled(planned(baseline_angle_deg=angle, baseline_m=length), 13.0) < 0.06


def test_of_a_narrow_band_the_critical_baseline_is_the_plane_wave_s():
    # Of a band of 1 MHz it is some millimetres, short against all ranges.
    radar = planned(start_frequency_hz=13.9995e9, stop_frequency_hz=14.0005e9)
    y = np.array([10.0, 16.0])
    look = radar.look_angle(0.0, y)
    across = formulas.critical_baseline(
        radar.slant_range(0.0, y), WAVELENGTH, look, radar.range_resolution
    )
    # The antennas' mean height counts: B / 2 H0.
    np.testing.assert_allclose(radar.critical_baseline(0.0, y) * np.sin(look), across, rtol=3e-3)


def test_grating_lobes_bound_width_and_spacing():
    radar = planned()
    width, slant = radar.unambiguous_width(0.0, 13.0), float(radar.slant_range(0.0, 13.0))
    # 4 d sin(squint) = the shortest wavelength; the aperture's ends change the mean by (L / r)^2.
    sine = (width / 2) / np.hypot(width / 2, slant)
    assert sine == pytest.approx(LIGHT / 15e9 / (4 * 0.01), rel=2e-3)
    assert planned(position_spacing_m=0.004).unambiguous_width(0.0, 13.0) == np.inf
    edges = width / 2 * np.array([-1, 1])
    assert radar.widest_spacing(edges, 13.0) == pytest.approx(0.01)
    assert radar.widest_spacing(edges[:1], 13.0) == np.inf
    assert radar.filled(*edges, 13.0) == pytest.approx(14 / 15)


def test_looks_are_resolution_cells_and_never_fewer_than_one():
    radar = planned()
    cell = radar.resolution(0.0, 13.0)
    assert radar.looks(1.0, 0.0, 13.0) == pytest.approx(1 / cell.prod())
    assert radar.looks(0.01, 0.0, 13.0) == 1


@pytest.mark.parametrize("system", SYSTEMS)
@pytest.mark.parametrize("factor", [0.2, 3.0])
def test_a_scaled_baseline_is_one_of_that_length(system, factor):
    scaled = planned(system=system, baseline_angle_deg=70.0).scaled(factor)
    built = planned(system=system, baseline_angle_deg=70.0, baseline_m=0.3 * factor)
    for end in ("transmitter", "receiver"):
        np.testing.assert_allclose(getattr(scaled.upper, end), getattr(built.upper, end))


@pytest.mark.parametrize("height", [0.1, 0.6, 2.0])
@pytest.mark.parametrize("noise", [0.0, 0.4])
def test_the_unwrapped_baseline_of_a_rail_is_lambda_r2_over_4_h_less_what_noise_takes(
    height, noise
):
    found = planned().unwrapped_baseline(height, 0.0, np.array([16.0, 10.0]), phase_std=noise)
    # lambda r2 / 2B = 2 h / (1 - 3 std / pi) at the near place.
    r2 = np.hypot(10.0, 2.0 + found)
    assert found == pytest.approx(WAVELENGTH * r2 / (4 * height) * (1 - 3 * noise / np.pi))


def test_an_array_s_unwrapped_baseline_has_twice_the_height_of_ambiguity_of_the_objects():
    radar = planned(system="transmit_pair")
    length = radar.unwrapped_baseline(0.8, 0.5, 12.0)
    built = planned(system="transmit_pair", baseline_m=length)
    assert float(built.height_of_ambiguity(0.5, 12.0)) == pytest.approx(1.6)


@pytest.mark.parametrize("noise", [0.05, 0.2, 0.35])
def test_settling_baselines_rise_to_the_longest_and_each_settles_the_next(noise):
    found = planned(baseline_m=0.9).settling_baselines(1.5, 0.0, 12.0, phase_std=noise)
    assert found[-1] == pytest.approx(0.9)
    short = planned().unwrapped_baseline(1.5, 0.0, 12.0, phase_std=noise)
    assert found[0] == pytest.approx(short, rel=1e-6)
    ratios = np.divide(found[1:], found[:-1])
    # One draw in a thousand of either phase is beyond 3.3 deviations.
    assert (3 * noise * np.hypot(1, ratios) < np.pi).all()
    # One antenna fewer would not do.
    fewer = (found[-1] / found[0]) ** (1 / max(len(found) - 2, 1))
    assert len(found) == 2 or 3 * noise * np.hypot(1, fewer) >= np.pi


def test_low_objects_need_no_further_antenna_and_noise_leaves_none():
    assert planned().settling_baselines(0.1, 0.0, 12.0) == pytest.approx((0.3,))
    assert planned().settling_baselines(0.6, 0.0, 12.0, phase_std=0.8) == ()
    assert planned().settling_baselines(0.6, 0.0, 12.0, phase_std=1.2) == ()


def test_objects_without_a_height_are_refused():
    with pytest.raises(ValueError, match="have no height"):
        planned().settling_baselines(0.0, 0.0, 12.0)


@pytest.mark.parametrize("system", SYSTEMS)
def test_report_sheet_and_figure_show_the_same_values(system):
    study = validation.check(
        validation.merge(
            STUDY.model_dump(mode="json"),
            {"radar": {"system": system}, "outputs": {"claims": False}, "variants": {}},
        )
    )
    shown = {name: value for name, value, _ in content.quantities(study)}
    listed = dict(acquisition.values(study))
    sheet = design.as_markdown(design.Sheet(study))
    # The sheet's middle column is the report's and the figure's place.
    rows = {
        cells[1].strip(): cells[3].strip()
        for cells in (line.split("|") for line in sheet.splitlines() if line.startswith("| "))
        if len(cells) == 6
    }
    assert instrument.middle(study.scene) == (0.0, 13.0) == instrument.middle(study.imaging)
    for name, row in (
        ("critical baseline of this attitude", "critical baseline of this attitude (m)"),
        ("a quarter of it, the rule of thumb", "a quarter of it (m)"),
        ("height of ambiguity", "height of ambiguity (m)"),
    ):
        assert shown[name] == rows[row], name
    assert f"{float(rows['resolution in x (cm)']):.1f}" == shown["resolution on the ground in x"]
    assert f"wavelength {shown['wavelength of the carrier, λ']} mm" in sheet
    assert f"unambiguous range {shown['unambiguous range']} m" in sheet
    assert shown["wavelength of the carrier, λ"] == "21.41"
    assert listed["height of ambiguity"] == f"{shown['height of ambiguity']} m"
    assert listed["resolution in x"] == f"{shown['resolution on the ground in x']} cm"
    assert listed[r"wavelength $\lambda$"] == "21.4 mm"
