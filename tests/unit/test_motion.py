from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.special import fresnel

import vinsar
from vinsar.foundations import variables
from vinsar.foundations.constants import SPEED_OF_LIGHT
from vinsar.prediction import design
from vinsar.processing import focusing
from vinsar.radar import motion, trajectory, waveform
from vinsar.simulation import echo
from vinsar.study import pipeline, validation
from vinsar.study.composition import StudyModel

FREQUENCY = waveform.frequencies(13e9, 15e9, 101)
WAVELENGTH = waveform.wavelength(waveform.carrier(FREQUENCY))
POINT = np.array([0.3, 13.0, 0.0])
CONFIG = Path(__file__).parents[2] / "config"


def draw(positions, seed=0, *, std_m=1.0, distribution="normal", spectrum="white", cycles=2.0):
    return motion.errors(
        positions,
        std_m=std_m,
        distribution=distribution,
        spectrum=spectrum,
        cycles_per_aperture=cycles,
        rng=np.random.default_rng(seed),
    )


# The variance of a sample variance is (kurtosis - 1) / N; five of its standard deviations.
@pytest.mark.parametrize(("distribution", "kurtosis"), [("uniform", 1.8), ("normal", 3.0)])
def test_white_errors_have_the_standard_deviation_and_the_shape(distribution, kurtosis):
    count = 100_000
    found = draw(count, std_m=0.02, distribution=distribution) / 0.02
    assert found.mean() == pytest.approx(0, abs=5 / np.sqrt(count))
    assert found.var() == pytest.approx(1, abs=5 * np.sqrt((kurtosis - 1) / count))
    assert (found**4).mean() == pytest.approx(kurtosis, rel=0.1)
    # Independent from one to the next.
    assert (found[1:] * found[:-1]).mean() == pytest.approx(0, abs=5 / np.sqrt(count))
    assert (np.abs(found).max() <= np.sqrt(3)) == (distribution == "uniform")


def test_a_vibration_is_a_sinusoid_of_random_phase():
    found = draw(801, std_m=0.02, spectrum="sinusoidal", cycles=3.0)
    turns = 2 * np.pi * 3 * np.linspace(0, 1, 801)
    basis = np.stack([np.sin(turns), np.cos(turns)], axis=1)
    parts, rest = np.linalg.lstsq(basis, found, rcond=None)[:2]
    assert np.hypot(*parts) == pytest.approx(0.02 * np.sqrt(2))
    assert rest == pytest.approx(0, abs=1e-20)
    starts = np.array([draw(2, seed, spectrum="sinusoidal")[0] for seed in range(2000)])
    # 2 sin^2 of a random phase has the variance 1/2.
    assert (starts**2).mean() == pytest.approx(1, abs=5 * np.sqrt(0.5 / 2000))


@pytest.mark.parametrize("distribution", ["uniform", "normal"])
def test_drift_has_the_standard_deviation_over_the_aperture(distribution):
    walks = np.array(
        [
            draw(81, seed, std_m=0.02, distribution=distribution, spectrum="random_walk")
            for seed in range(4000)
        ]
    )
    # The mean square of a walk varies by 2 / sqrt(3) of its mean.
    assert (walks**2).mean() == pytest.approx(0.02**2, rel=5 * 1.16 / np.sqrt(4000))
    steps = np.diff(walks, axis=1)
    assert steps.std() == pytest.approx(0.02 / np.sqrt(41), rel=0.01)
    assert (steps[:, 1:] * steps[:, :-1]).mean() / steps.var() == pytest.approx(0, abs=0.01)


@pytest.mark.parametrize("spectrum", ["white", "sinusoidal", "random_walk"])
@pytest.mark.parametrize("distribution", ["uniform", "normal"])
def test_the_level_scales_one_and_the_same_draw(spectrum, distribution):
    one, four = (
        draw(81, 5, std_m=std, distribution=distribution, spectrum=spectrum) for std in (1.0, 4.0)
    )
    np.testing.assert_allclose(four, 4 * one, rtol=1e-14)
    assert not np.allclose(one, draw(81, 6, distribution=distribution, spectrum=spectrum))


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_transmitter_and_receiver_move_alike_along_one_axis(bistatic, axis):
    moved = motion.displace(
        bistatic, axis=axis, draw=lambda channel, positions: (channel + 1) * np.arange(positions)
    )
    number = "xyz".index(axis)
    for name in ("transmitter", "receiver"):
        shift = moved[name].values - bistatic[name].values
        np.testing.assert_allclose(shift[0, :, number], np.arange(81), atol=1e-12)
        np.testing.assert_allclose(shift[1, :, number], 2 * np.arange(81), atol=1e-12)
        assert np.abs(np.delete(shift, number, axis=-1)).max() == 0


STANDING = {
    "forward_speed_m_per_s": 0.0, "scan_duration_s": 0.5, "speed_correction": "none",
    "speed_error_m_per_s": 0.0, "scan_interval_s": None,
}  # fmt: skip


def errors_of(rail, affected="recorded", seed=1, realization=0, **options):
    """The errors that a study draws, by channel and position, m."""
    section = {
        "axis": "y", "level_wavelengths": 0.1, "distribution": "uniform", "channels": "common",
        "spectrum": "white", "cycles_per_aperture": 2.0, "affects": "recorded",
    } | options  # fmt: skip
    study = StudyModel.part(
        {
            "seed": seed, "realization": realization, "motion": section, "vehicle": STANDING,
            "radar.start_frequency_hz": 13e9, "radar.stop_frequency_hz": 15e9,
            "radar.frequency_count": 101, "radar.system": "rail",
        }
    )  # fmt: skip
    name = f"{affected}_trajectory"
    product = pipeline.STAGES[name].compute({"trajectory": rail}, study)
    return (product["transmitter"] - rail["transmitter"]).values[..., 1]


def test_both_antennas_share_the_error_of_the_vehicle(rail):
    lower, upper = errors_of(rail, level_wavelengths=0.5)
    np.testing.assert_allclose(lower, upper, atol=1e-15)
    assert lower.std() == pytest.approx(0.5 * WAVELENGTH, rel=0.25)
    assert np.abs(lower).max() <= np.sqrt(3) * 0.5 * WAVELENGTH


def test_each_antenna_has_an_error_of_its_own_where_it_is_measured_by_itself(rail):
    lower, upper = errors_of(rail, channels="independent")
    assert abs(np.corrcoef(lower, upper)[0, 1]) < 5 / np.sqrt(81)


def test_seed_and_realization_draw_other_errors_and_a_key_beside_them_does_not(rail):
    base = errors_of(rail)
    np.testing.assert_array_equal(errors_of(rail), base)
    for other in (errors_of(rail, seed=2), errors_of(rail, realization=1)):
        assert abs(np.corrcoef(other[0], base[0])[0, 1]) < 5 / np.sqrt(81)
    np.testing.assert_allclose(errors_of(rail, level_wavelengths=0.2), 2 * base, atol=1e-15)


def test_either_the_recorded_or_the_true_positions_err(rail):
    assert np.abs(errors_of(rail, affected="true")).max() == 0
    assert np.abs(errors_of(rail, affects="true")).max() == 0
    np.testing.assert_array_equal(errors_of(rail, affected="true", affects="true"), errors_of(rail))
    assert np.abs(errors_of(rail, level_wavelengths=0.0)).max() == 0


# Along z the range changes by a sixth of the error only.
@pytest.mark.parametrize(("axis", "level"), [("y", 0.02), ("z", 0.1)])
def test_true_and_recorded_errors_have_opposite_effects_to_first_order(
    rail, scatterers, axis, level
):
    """What imaging adds for an error of its record, the echo lacks for one of the true path."""
    moved = motion.displace(
        rail,
        axis=axis,
        draw=lambda channel, positions: draw(
            positions, 3 + channel, std_m=level * WAVELENGTH, spectrum="random_walk"
        ),
    )
    x, y = np.array([0.0, POINT[0]]), np.array([12.0, POINT[1]])

    def image(truth, recorded):
        profiles = focusing.compress(
            echo.simulate(scatterers(POINT), truth, frequency=FREQUENCY, accuracy_db=None),
            near_range_m=11.0,
            far_range_m=15.0,
            oversampling=32,
        )
        return focusing.backproject(profiles, recorded, x=x, y=y)["image"].values[:, 1, 1]

    from_record, from_path = image(rail, moved), image(moved, rail)
    # By theory: the mean of 4 pi / lambda times the change of range.
    antennas = rail["transmitter"].values
    cosine = ((antennas - POINT) / np.linalg.norm(antennas - POINT, axis=-1)[..., None])[
        ..., "xyz".index(axis)
    ]
    shift = (moved["transmitter"].values - antennas)[..., "xyz".index(axis)]
    theory = (4 * np.pi / WAVELENGTH * cosine * shift).mean(axis=-1)
    assert np.abs(theory).min() > 0.02
    # The third order, (4 pi 0.02)^3 / 6, and interpolation by -76 dB at an oversampling of 32.
    np.testing.assert_allclose(np.angle(from_record), theory, atol=0.003)
    np.testing.assert_allclose(np.angle(from_path), -theory, atol=0.003)


def gain(truth, recorded, frequency=FREQUENCY, place=None):
    return motion.point_gain(
        truth,
        recorded,
        POINT,
        np.tile(POINT, (2, 1)) if place is None else place,
        frequency,
        np.full(frequency.size, 1 / frequency.size),
        np.full(81, 1 / 81),
    )


def test_without_errors_a_point_keeps_its_focus(rail, bistatic):
    for antennas in (rail, bistatic):
        np.testing.assert_allclose(gain(antennas, antennas), 1, rtol=1e-12)


def test_the_point_gain_is_that_of_the_direct_sum(bistatic):
    moved = motion.displace(
        bistatic, axis="y", draw=lambda channel, n: draw(n, channel, std_m=0.3 * WAVELENGTH)
    )
    weights = waveform.window("hann", FREQUENCY.size), waveform.window("hamming", 81)

    def path(antennas):
        legs = [
            np.linalg.norm(antennas[name].values - POINT, axis=-1)
            for name in ("transmitter", "receiver")
        ]
        return legs[0] + legs[1]

    turn = 2j * np.pi * FREQUENCY / SPEED_OF_LIGHT
    terms = np.exp(turn * (path(moved) - path(bistatic))[..., None])
    direct = np.abs(np.einsum("clk,k,l->c", terms, *weights))
    found = motion.point_gain(bistatic, moved, POINT, np.tile(POINT, (2, 1)), FREQUENCY, *weights)
    np.testing.assert_allclose(found, direct, rtol=1e-10)
    assert found.max() < 0.5


@pytest.mark.parametrize("level", [0.05, 0.1, 0.2])
@pytest.mark.parametrize("distribution", ["uniform", "normal"])
def test_the_point_gain_follows_the_characteristic_function(rail, distribution, level):
    """E|g|^2 = m^2 + (1 - m^2) / N with m = sin(a) / a or exp(-s^2 / 2)."""
    carrier = waveform.carrier(FREQUENCY)
    narrow = waveform.frequencies(carrier - 1e6, carrier + 1e6, 3)
    std = level * WAVELENGTH
    found = [
        gain(
            rail,
            motion.displace(
                rail,
                axis="y",
                draw=lambda channel, n, seed=seed: draw(
                    n, [seed, channel], std_m=std, distribution=distribution
                ),
            ),
            narrow,
        )
        for seed in range(150)
    ]
    cosine = POINT[1] / np.linalg.norm(POINT - [0, 0, 2.15])
    phase = 4 * np.pi * level * cosine
    if distribution == "uniform":
        mean = np.sinc(np.sqrt(3) * phase / np.pi)
    else:
        mean = np.exp(-(phase**2) / 2)
    power = np.square(found)
    spread = power.std() / np.sqrt(power.size)
    # The direction differs by 0.3 % between the antennas and over the aperture.
    expected = mean**2 + (1 - mean**2) / 81
    assert power.mean() == pytest.approx(expected, abs=5 * spread + 0.006 * phase**2 * expected)


@pytest.mark.parametrize(("speed", "duration"), [(1.0, 0.5), (10.0, 0.5), (10.0, 0.005)])
def test_the_aperture_turns_by_the_yaw_angle_about_its_centre(bistatic, speed, duration):
    moved = motion.advance(bistatic, speed_m_per_s=speed, duration_s=duration)
    yaw = np.arctan2(speed, 0.8 / duration)
    for name in ("transmitter", "receiver"):
        way = moved[name].values - bistatic[name].values
        assert np.abs(way[..., [0, 2]]).max() == 0
        np.testing.assert_allclose(way.mean(axis=1), 0, atol=1e-12)
        axis = moved[name].values[:, -1] - moved[name].values[:, 0]
        np.testing.assert_allclose(np.arctan2(axis[:, 1], axis[:, 0]), yaw)
        steps = np.diff(moved[name].values, axis=1)
        np.testing.assert_allclose(steps, np.broadcast_to(axis[:, None] / 80, steps.shape))
    assert motion.slope(speed, aperture_length_m=0.8, duration_s=duration) == pytest.approx(
        np.tan(yaw)
    )


STILL = {
    "axis": "y", "level_wavelengths": 0.0, "distribution": "uniform", "channels": "common",
    "spectrum": "white", "cycles_per_aperture": 2.0, "affects": "recorded",
}  # fmt: skip
SCAN = STANDING | {"forward_speed_m_per_s": 4.0}


def driven(rail, name, section=STILL, realization=0, **options):
    """Way ahead of the antennas in one of the trajectories of a study, (channel, position), m."""
    study = StudyModel.part(
        {
            "seed": 1, "realization": realization, "motion": section, "vehicle": SCAN | options,
            "radar.start_frequency_hz": 13e9, "radar.stop_frequency_hz": 15e9,
            "radar.frequency_count": 101, "radar.system": "rail",
        }
    )  # fmt: skip
    product = pipeline.STAGES[f"{name}_trajectory"].compute({"trajectory": rail}, study)
    return (product["transmitter"] - rail["transmitter"]).values[..., 1]


def test_the_truth_drives_and_the_record_has_what_imaging_is_told(rail):
    way = 4.0 * 0.5 * np.linspace(-0.5, 0.5, 81)
    for correction, told in (("none", 0.0), ("exact", 1.0), ("sensor", 1.0)):
        np.testing.assert_allclose(
            driven(rail, "true", speed_correction=correction), np.tile(way, (2, 1)), atol=1e-15
        )
        np.testing.assert_allclose(
            driven(rail, "recorded", speed_correction=correction),
            np.tile(told * way, (2, 1)),
            atol=1e-15,
        )


def test_the_sensor_s_error_is_one_draw_a_realization_that_scales(rail):
    def told(realization=0, **options):
        way = driven(
            rail, "recorded", realization=realization, speed_correction="sensor", **options
        )
        return (way[0, -1] - way[0, 0]) / 0.5

    errors = np.array([told(n, speed_error_m_per_s=0.3) - 4.0 for n in range(400)])
    assert errors.mean() == pytest.approx(0, abs=5 * 0.3 / np.sqrt(400))
    assert errors.std() == pytest.approx(0.3, rel=5 / np.sqrt(2 * 400))
    assert told(7, speed_error_m_per_s=0.6) - 4.0 == pytest.approx(2 * errors[7])
    faster = told(7, speed_error_m_per_s=0.3, forward_speed_m_per_s=9.0)
    assert faster - 9.0 == pytest.approx(errors[7])


def test_position_errors_add_to_the_way_of_the_vehicle(rail):
    for affected in ("true", "recorded"):
        shaken = STILL | {"level_wavelengths": 0.5, "affects": affected}
        found = driven(rail, affected, shaken, speed_correction="exact")
        way = driven(rail, affected, speed_correction="exact")
        np.testing.assert_allclose(
            found - way, errors_of(rail, affected, affects=affected, level_wavelengths=0.5)
        )


@given(
    x=st.floats(-8, 8), y=st.floats(-20, 20).filter(lambda y: abs(y) > 1),
    true=st.floats(0, 8), told=st.floats(0, 8),
)  # fmt: skip
def test_the_image_keeps_distance_side_and_place_along_the_axis(x, y, true, told):
    assume(abs(y - true * x) > 0.01)
    found_x, found_y = motion.imaged_place(x, y, true_slope=true, told_slope=told)
    reach = abs(x + true * y) / np.hypot(1, told) - np.hypot(x, y)
    if np.isnan(found_x):
        assert reach > -1e-9
        return
    assert np.hypot(found_x, found_y) == pytest.approx(np.hypot(x, y))
    assert found_x + told * found_y == pytest.approx(x + true * y, abs=1e-9)
    assert (found_y - told * found_x) * (y - true * x) > -1e-6
    same = motion.imaged_place(x, y, true_slope=true, told_slope=true)
    np.testing.assert_allclose(same, (x, y), atol=1e-6)


ALIKE = np.full(81, 1 / 81)


@pytest.mark.parametrize(("true", "told"), [(0.3, 0.0), (0.0, 0.3), (3.0, 3.01), (0.05, 0.02)])
def test_the_ranges_match_best_where_theory_has_the_image(rail, true, told):
    truth, recorded = (
        motion.advance(rail, speed_m_per_s=slope * 1.6, duration_s=0.5) for slope in (true, told)
    )
    place = motion.peak_place(truth, recorded, POINT, ALIKE)
    theory = motion.imaged_place(*POINT[:2], true_slope=true, told_slope=told)
    # Left over is (k^2 - k'^2) s^2 / 2r over s = -a..a: a mean, which moves the range, and, as r
    # changes with s by s (x + k y) / r, a cubic, whose slope 3/5 a^2 moves the azimuth.
    rest = abs(true**2 - told**2) * 0.4**2 / (2 * 13.2)
    rest *= 1 / 3 + 3 / 5 * (POINT[0] + true * POINT[1]) / 13.2
    np.testing.assert_allclose(place[:, :2], np.tile(theory, (2, 1)), atol=2 * rest)
    assert np.hypot(*(theory - POINT[:2])) > 50 * rest


@pytest.mark.parametrize(("true", "told"), [(0.5, 0.0), (0.9, 0.0), (3.0, 3.1)])
def test_a_wrong_speed_defocuses_by_the_quadratic_rest(rail, true, told):
    carrier = waveform.carrier(FREQUENCY)
    narrow = waveform.frequencies(carrier - 1e6, carrier + 1e6, 3)
    truth, recorded = (
        motion.advance(rail, speed_m_per_s=slope * 1.6, duration_s=0.5) for slope in (true, told)
    )
    place = motion.peak_place(truth, recorded, POINT, ALIKE)
    # pi L^2 (k^2 - k'^2) / (2 lambda r) at the ends of the aperture; a Fresnel integral over it.
    edge = np.pi * 0.8**2 * abs(true**2 - told**2) / (2 * WAVELENGTH * np.hypot(13.0, 2.15))
    at = np.sqrt(2 * edge / np.pi)
    sine, cosine = fresnel(at)
    # Between the antennas and over the aperture the range differs by a few percent.
    expected = np.hypot(sine, cosine) / at
    found = gain(truth, recorded, narrow, place)
    np.testing.assert_allclose(found, expected, atol=0.05 * (1 - expected) + 0.002)
    assert gain(truth, recorded, narrow).max() < 0.3 < found.min()


def test_the_error_that_suffices_is_where_the_spread_passes_the_limit():
    levels, spread = np.array([0.0, 1.0, 2.0, 4.0]), np.array([1.0, 1.02, 1.18, 1.5])
    assert motion.sufficient_error(levels, spread, factor=1.1) == pytest.approx(1.5)
    assert motion.sufficient_error(levels, spread, factor=1.01) == pytest.approx(0.5)
    assert motion.sufficient_error(levels, spread, factor=2.0) == np.inf


def test_the_margin_of_the_profiles_covers_the_errors_or_says_so(rail):
    profiles = variables.dataset(
        "profiles",
        {"profile": np.zeros((2, 81, 8), np.complex64), "carrier_frequency": 14e9},
        {"slant_range": np.linspace(11, 14, 8)},
    )
    far = motion.displace(rail, axis="y", draw=lambda channel, n: np.full(n, -2.0 - channel))
    near, most = trajectory.range_extent(far, np.array([0.0, 1.0]), np.array([11.0, 12.0]))
    assert most > 14 > near
    with pytest.raises(ValueError, match=r"the profiles cover 11.00 to 14.00 m of slant range"):
        focusing.backproject(profiles, far, x=np.array([0.0, 1.0]), y=np.array([11.0, 12.0]))


def test_an_array_on_a_moving_vehicle_drives_as_long_as_it_dwells_on_its_samples():
    study = validation.check(
        validation.merge(
            vinsar.load().model_dump(mode="json"),
            {
                "radar": {"system": "transmit_pair", "dwell_s": 1e-6},
                "vehicle": {"forward_speed_m_per_s": 5.0, "scan_duration_s": 0.5},
                "outputs": {"claims": False},
                "sweeps": {},
                "variants": {},
            },
        )
    )
    still = pipeline.run_stage("trajectory", {}, study)
    moved = pipeline.run_stage("true_trajectory", {"trajectory": still}, study)
    way = (moved["receiver"] - still["receiver"]).values[0, :, 1]
    # Two channels, 81 elements, 401 frequencies, a microsecond each: not the cart's half second.
    assert np.ptp(way) == pytest.approx(5.0 * 2 * 81 * 401 * 1e-6)
    assert f"{np.ptp(way):.2f} m in it" in design.as_markdown(design.Sheet(study))
