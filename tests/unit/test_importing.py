"""Radars' files: a simulated echo, written in each form and format, comes back.

The echo is a direct sum over a few targets at the antennas' exact paths.
"""

from __future__ import annotations

import h5py
import numpy as np
import pytest
import skrf
import xarray as xr
from scipy import io

from vinsar.foundations.constants import SPEED_OF_LIGHT as C
from vinsar.readers import files, importing, sign

FREQUENCY = np.linspace(8.0e9, 8.9e9, 91)
TARGETS = np.array([[0.2, 5.0, 0.0], [-0.6, 6.1, 0.3], [0.9, 7.3, 0.1]])
AMPLITUDES = np.array([1.0, 0.8j, -0.6])


def antennas(channels=1, positions=60):
    x = np.linspace(-0.5, 0.5, positions)
    places = np.zeros((channels, positions, 3))
    places[..., 0] = x
    places[..., 1] = 0.01 * np.sin(5 * x)
    places[..., 2] = 2.0 + 0.3 * np.arange(channels)[:, None]
    return places


def simulated(places, frequency=FREQUENCY):
    paths = 2 * np.linalg.norm(places[..., None, :] - TARGETS, axis=-1)
    turns = frequency * paths[..., None] / C
    return (AMPLITUDES[:, None] * np.exp(-2j * np.pi * (turns % 1))).sum(axis=-2)


PLACES = antennas()
ECHO = simulated(PLACES)


def back(form, *paths, **options):
    return importing.read(form, paths, importing.Options(**options))


def assert_same(found, echo=ECHO, places=PLACES, atol=1e-12):
    np.testing.assert_allclose(found.frequency, FREQUENCY, rtol=1e-12)
    np.testing.assert_allclose(found.echo, echo, atol=atol)
    np.testing.assert_allclose(found.transmitter, places, atol=1e-12)
    np.testing.assert_allclose(found.receiver, places, atol=1e-12)


# Formats


def matlab_73(path, arrays):
    """Write HDF5 as MATLAB does: 512 bytes ahead, transposed, complex as a compound."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in arrays.items():
            stored = np.asarray(values).T
            if np.iscomplexobj(stored):
                parts = np.empty(stored.shape, [("real", "f8"), ("imag", "f8")])
                parts["real"], parts["imag"] = stored.real, stored.imag
                stored = parts
            file[name] = stored
    with open(path, "r+b") as file:  # noqa: PTH123
        file.write(b"MATLAB 7.3 MAT-file".ljust(512))


ARRAYS = {"echo": ECHO[0], "frequency": FREQUENCY, "antenna": PLACES[0]}


@pytest.mark.parametrize("kind", ["npz", "mat", "struct", "mat73", "h5", "nc"])
def test_every_format_gives_the_same_echo(tmp_path, kind):
    path = tmp_path / f"echo.{kind[:3]}"
    if kind == "npz":
        np.savez(path, **ARRAYS)
    elif kind == "mat":
        io.savemat(path, ARRAYS)
    elif kind == "struct":
        path = tmp_path / "echo.mat"
        # As a phase history comes: in a structure, positions as columns.
        columns = dict(zip("xyz", PLACES[0].T, strict=True))
        io.savemat(path, {"data": {"fp": ECHO[0].T, "freq": FREQUENCY, **columns}})
    elif kind == "mat73":
        matlab_73(path, ARRAYS)
    elif kind == "h5":
        with h5py.File(path, "w") as file:
            for name, values in ARRAYS.items():
                file[name] = values
    else:
        parts = {"echo_real": ECHO[0].real, "echo_imag": ECHO[0].imag}
        xr.Dataset(
            {name: (("position", "frequency"), part) for name, part in parts.items()}
            | {"antenna": (("position", "axis"), PLACES[0], {"units": "m"})},
            {"frequency": ("frequency", FREQUENCY / 1e9, {"units": "GHz"})},
        ).to_netcdf(path)
    found = back("stepped", path)
    assert_same(found)
    assert any("by its name" in note for note in found.notes)
    declared = any("declares no units" in note for note in found.notes)
    assert declared == (kind != "nc")


def test_a_network_analyser_has_a_file_for_each_position(tmp_path):
    for position in range(60):
        network = skrf.Network(f=FREQUENCY, s=ECHO[0, position, :, None, None] / 10, f_unit="Hz")
        network.write_touchstone(f"p{position:02d}", dir=str(tmp_path))
    names = ["x", "y", "z"]
    rows = "\n".join(",".join(map(repr, map(float, row))) for row in PLACES[0])
    (tmp_path / "places.csv").write_text(",".join(f"{n} (m)" for n in names) + "\n" + rows)
    found = back("stepped", *sorted(tmp_path.glob("*.s1p")), tmp_path / "places.csv")
    assert_same(found, ECHO / 10, atol=1e-9)


def test_several_files_follow_each_other(tmp_path):
    for number, part in enumerate((slice(0, 25), slice(25, 60))):
        np.savez(
            tmp_path / f"{number}.npz",
            echo=ECHO[0, part], frequency=FREQUENCY, antenna=PLACES[0, part],
        )  # fmt: skip
    assert_same(back("stepped", tmp_path / "0.npz", tmp_path / "1.npz"))


def test_pickles_are_not_opened(tmp_path):
    np.save(tmp_path / "evil.npy", np.array([{"a": 1}], dtype=object), allow_pickle=True)
    with pytest.raises(ValueError, match=r"evil\.npy"):
        files.load(tmp_path / "evil.npy")


@pytest.mark.parametrize("name", ["a.nc", "a.mat", "a.npz", "a.s2p", "a.h5", "a.csv"])
def test_a_file_of_another_format_is_refused(tmp_path, name):
    (tmp_path / name).write_bytes(b"\x89\x01 no such thing\n1\n")
    with pytest.raises(ValueError, match=r"a\."):
        files.load(tmp_path / name)


def test_a_table_must_name_its_columns(tmp_path):
    (tmp_path / "a.csv").write_text("1,2,3\n4,5,6\n")
    with pytest.raises(ValueError, match="name the columns"):
        files.load(tmp_path / "a.csv")
    (tmp_path / "a.csv").write_text("x,y\n4,5\n6\n")
    with pytest.raises(ValueError, match="line 3 has not the 2 columns"):
        files.load(tmp_path / "a.csv")


# Forms


def test_a_beat_comes_back(tmp_path):
    step, rate = 1e7, 1e12
    np.savez(tmp_path / "beat.npz", beat=ECHO[0].conj(), antenna=PLACES[0])
    found = back(
        "dechirped", tmp_path / "beat.npz", start_frequency_hz=8e9, sweep_rate_hz_per_s=rate,
        sample_rate_hz=rate / step,
    )  # fmt: skip
    # At this rate the residual video phase would be pi a T^2 = 0.01 rad; it is not in this beat.
    assert_same(found, atol=0.3)
    assert any("residual video phase" in note for note in found.notes)


def test_pulses_come_back(tmp_path):
    # A grid of frequencies on which the band lies: 10 MHz up to 10.24 GHz.
    spectrum = np.zeros((60, 1025), complex)
    spectrum[:, 800:891] = ECHO[0]
    samples = np.fft.irfft(spectrum, 2048) * 2048 / 2
    step = C / 2 / 20.48e9
    io.savemat(
        tmp_path / "pulses.mat",
        {"pulse": samples / 2048, "range": step * np.arange(2048), "antenna": PLACES[0]},
    )
    found = back("pulses", tmp_path / "pulses.mat", band_hz=(7.999e9, 8.901e9))
    assert_same(found, atol=1e-9)


def test_a_reference_range_comes_back(tmp_path):
    reference = np.linalg.norm(PLACES[0] - [0, 6, 0], axis=-1)
    compensated = ECHO[0] * np.exp(4j * np.pi * FREQUENCY * reference[:, None] / C)
    np.savez(
        tmp_path / "phase.npz", fp=compensated.T, freq=FREQUENCY, antenna=PLACES[0], r0=reference
    )
    assert_same(back("stepped", tmp_path / "phase.npz"), atol=1e-9)


def test_two_channels_and_their_own_receivers(tmp_path):
    places = antennas(2)
    echo = simulated(places)
    np.savez(
        tmp_path / "two.npz",
        low=echo[0],
        high=echo[1].T,
        f=FREQUENCY,
        at=places[0],
        above=places[1],
    )
    found = back(
        "stepped", tmp_path / "two.npz", samples=("low", "high"), positions=("at", "above")
    )
    assert_same(found, echo, places)
    np.savez(tmp_path / "cube.npz", echo=np.moveaxis(echo, 0, 2), f=FREQUENCY, antenna=places)
    assert_same(back("stepped", tmp_path / "cube.npz"), echo, places)
    found = back(
        "stepped", tmp_path / "two.npz", samples=("low",), positions=("at",), receivers=("above",)
    )
    np.testing.assert_array_equal(found.receiver, places[1:])


def test_an_index_picks_a_part(tmp_path):
    np.savez(tmp_path / "cube.npz", scan=ECHO.transpose(1, 0, 2), f=FREQUENCY, x=PLACES[0, :, 0])
    found = back(
        "stepped", tmp_path / "cube.npz", samples=("scan[:,0,:]",), positions=("x,0.0,2.0",)
    )
    np.testing.assert_allclose(found.echo, ECHO)
    np.testing.assert_allclose(found.transmitter[0, :, 2], 2.0)
    with pytest.raises(ValueError, match="is not an index"):
        back("stepped", tmp_path / "cube.npz", samples=("scan[__import__]",), positions=("x,0,2",))


# Positions


def test_positions_of_their_own_times_are_interpolated(tmp_path):
    time, own = np.linspace(1, 4, 60), np.linspace(0, 5, 501)
    place = np.stack([0.3 * own - 0.7, 0.02 * own**2, 2 + 0.01 * own], axis=-1)
    np.savez(tmp_path / "echo.npz", echo=ECHO[0], f=FREQUENCY, t=time)
    rows = "\n".join(",".join(map(repr, map(float, row))) for row in np.c_[own, place])
    (tmp_path / "capture.csv").write_text("clock,x,y,z\n" + rows)
    paths = tmp_path / "echo.npz", tmp_path / "capture.csv"
    found = back("stepped", *paths, positions_time="clock")
    # A cubic spline has polynomials of the second degree exactly.
    expected = np.stack([0.3 * time - 0.7, 0.02 * time**2, 2 + 0.01 * time], axis=-1)
    np.testing.assert_allclose(found.transmitter[0], expected, atol=1e-9)
    np.testing.assert_allclose(found.time, time)
    late = rows.splitlines()[100:]
    (tmp_path / "capture.csv").write_text("clock,x,y,z\n" + "\n".join(late[50:]))
    with pytest.raises(ValueError, match="leave out what has no position"):
        back("stepped", *paths, positions_time="clock")


@pytest.mark.parametrize("angle", [0.0, 35.0, 120.0, -90.0])
def test_coordinates_are_turned_to_the_scene(tmp_path, angle):
    turn = np.deg2rad(angle)
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    places, scene = PLACES[0].copy(), np.array([0.4, 6.0])
    places[:, 1] = 0  # a straight aperture has its direction exactly
    centered = places.copy()
    places[:, :2] = places[:, :2] @ rotation.T + [1000.0, -500.0]
    places[:, 2] += 120.0
    np.savez(tmp_path / "echo.npz", echo=ECHO[0], f=FREQUENCY, antenna=places)
    look_at = tuple(rotation @ scene + [1000.0, -500.0])
    found = back("stepped", tmp_path / "echo.npz", look_at=look_at, ground_m=120.0)
    np.testing.assert_allclose(found.transmitter[0], centered, atol=1e-9)
    np.testing.assert_allclose(found.scene_m, scene, atol=1e-9)


# What cannot be told


@pytest.mark.parametrize(
    ("change", "options", "word"),
    [
        ({"echo": None}, {}, "no array has a usual name for the samples"),
        ({"frequency": None}, {}, "the frequency must be given"),
        ({"antenna": None}, {}, "no array has a usual name for the positions"),
        ({"antenna": PLACES[0, :59]}, {}, "do not fit"),
        ({"antenna": PLACES[0, :, :2]}, {}, "positions have x, y and z"),
        ({"echo": ECHO[0, :, :60]}, {}, "say what its dimensions are"),
        ({}, {"samples": ("other",)}, "there is no array 'other'"),
        ({}, {"order": "frequency,position"}, "do not fit 91 frequencies"),
        ({"echo": np.where(np.arange(91) == 7, np.nan, ECHO[0])}, {}, "60 samples are missing"),
        ({"t": np.arange(5.0)}, {}, "5 times do not fit 60 positions"),
    ],
)
def test_what_is_missing_is_said(tmp_path, change, options, word):
    arrays = {name: values for name, values in (ARRAYS | change).items() if values is not None}
    np.savez(tmp_path / "echo.npz", **arrays)
    with pytest.raises(ValueError, match=word):
        back("stepped", tmp_path / "echo.npz", **options)


def test_a_square_of_samples_has_to_be_explained(tmp_path):
    places = antennas(positions=91)
    np.savez(tmp_path / "echo.npz", echo=simulated(places)[0].T, f=FREQUENCY, antenna=places[0])
    with pytest.raises(ValueError, match="--order"):
        back("stepped", tmp_path / "echo.npz")
    found = back("stepped", tmp_path / "echo.npz", order="frequency,position")
    assert_same(found, simulated(places), places)


@pytest.mark.parametrize(("form", "word"), [("dechirped", "sample_rate_hz"), ("video", "no form")])
def test_a_form_needs_what_it_needs(tmp_path, form, word):
    np.savez(tmp_path / "echo.npz", echo=ECHO[0], antenna=PLACES[0])
    with pytest.raises(ValueError, match=word):
        back(form, tmp_path / "echo.npz")


# The measurement that comes out


def test_a_measurement_is_read_back(tmp_path):
    np.savez(tmp_path / "echo.npz", t=np.arange(60.0), **ARRAYS)
    found = back("stepped", tmp_path / "echo.npz")
    found.dataset().to_netcdf(tmp_path / "echo.nc")
    again = back("stepped", tmp_path / "echo.nc")
    # It is kept in single precision.
    np.testing.assert_allclose(again.echo, ECHO, atol=1e-6)
    np.testing.assert_array_equal(again.transmitter, found.transmitter)
    np.testing.assert_array_equal(again.time, found.time)


# The sign


@pytest.mark.parametrize("channels", [1, 2])
def test_targets_tell_the_sign(channels):
    places = antennas(channels)
    echo = simulated(places)
    assert sign.compare(echo, FREQUENCY, places, places).verdict == "right"
    wrong = sign.compare(echo.conj(), FREQUENCY, places, places)
    assert wrong.verdict == "wrong"
    assert "WRONG" in wrong.sentence


def speckle(channels, seed):
    """Return the echo of rough level ground, without a target that stands out."""
    rng = np.random.default_rng(seed)
    places = antennas(channels, positions=40)
    ground = np.column_stack([rng.uniform(-3, 3, 1200), rng.uniform(4, 9, 1200), np.zeros(1200)])
    echo = np.zeros((channels, 40, FREQUENCY.size), complex)
    for part in np.array_split(ground, 30):
        paths = 2 * np.linalg.norm(places[..., None, :] - part, axis=-1)
        echo += np.exp(-2j * np.pi * (FREQUENCY * paths[..., None] / C % 1)).sum(axis=-2)
    return echo, places


def test_two_channels_tell_the_sign_on_rough_ground():
    echo, places = speckle(2, seed=1)
    assert sign.compare(echo, FREQUENCY, places, places).verdict == "right"
    assert sign.compare(echo.conj(), FREQUENCY, places, places).verdict == "wrong"


def test_one_channel_on_rough_ground_is_undecided():
    echo, places = speckle(1, seed=1)
    assert sign.compare(echo, FREQUENCY, places, places).verdict == "undecided"
