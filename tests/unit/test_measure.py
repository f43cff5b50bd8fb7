"""The commands for measured data, from a radar's file to a calibrated measurement."""

from __future__ import annotations

import json
import sys

import numpy as np
import pytest
import xarray as xr

from vinsar import __main__ as command
from vinsar.foundations.constants import SPEED_OF_LIGHT as C

REFLECTOR = np.array([0.3, 4.0, 0.1])


@pytest.fixture
def run(monkeypatch, capsys):
    def call(*words):
        monkeypatch.setattr(sys, "argv", ["./run", *map(str, words)])
        code = command.main()
        out = capsys.readouterr()
        return code, out.out + out.err

    return call


@pytest.fixture
def recorded(tmp_path):
    """Write echoes of a reflector whose ranges are 0.42 m too long."""
    time, frequency = np.linspace(0, 8, 80), np.linspace(3e9, 4.8e9, 90)
    places = np.stack([0.2 * (time - 4), 0 * time, 0 * time + 1.8], axis=-1)
    ranges = np.linalg.norm(places - REFLECTOR, axis=-1) + 0.42
    echo = np.exp(-4j * np.pi * frequency * ranges[:, None] / C)
    np.savez(tmp_path / "scan.npz", echo=echo, freq=frequency, antenna=places, t=time)
    return tmp_path / "scan.npz"


def test_a_scan_is_imported_and_calibrated(run, recorded, tmp_path):
    code, said = run("import", "stepped", recorded, "-o", tmp_path / "echo.nc")
    assert code == 0
    assert "samples: 'echo', by its name" in said
    assert "'freq' declares no units and is taken in hz" in said
    assert "sign of the phase: right" in said
    assert (tmp_path / "echo.png").read_bytes().startswith(b"\x89PNG")
    code, said = run(
        "calibrate", tmp_path / "echo.nc", "-o", tmp_path / "right.nc",
        "--reflector", ",".join(map(str, REFLECTOR)), "--apply", "range",
    )  # fmt: skip
    assert code == 0
    assert "range bias: 0.42 +-" in said
    with xr.open_dataset(tmp_path / "right.nc") as stored:
        record = json.loads(stored.attrs["vinsar_calibration"])
        assert record["applied"] == ["range"]
        assert record["estimates"]["range_bias_m"]["value"] == pytest.approx(0.42, abs=1e-3)
        assert "samples: 'echo', by its name" in stored.attrs["comment"]
        # What was taken out of the phase at one frequency.
        echo = (stored["echo_real"] + 1j * stored["echo_imag"]).values[0]
        places, frequency = stored["transmitter"].values[0], stored["frequency"].values
    ranges = np.linalg.norm(places - REFLECTOR, axis=-1)[:, None]
    left = np.angle(echo * np.exp(4j * np.pi * frequency * ranges / C))
    # A millimetre of bias is 0.2 rad at 4.8 GHz.
    assert np.abs(left).max() < 0.1


def test_a_wrong_sign_is_told(run, recorded, tmp_path):
    code, said = run("import", "stepped", recorded, "-o", tmp_path / "a.nc", "--sign", "1")
    assert code == 0
    assert "sign of the phase: WRONG" in said


def test_what_goes_wrong_is_a_sentence(run, recorded, tmp_path):
    code, said = run("import", "pulses", recorded, "-o", tmp_path / "echo.nc")
    assert code == 2
    assert said.startswith("vinsar: the range must be given")
    assert not (tmp_path / "echo.nc").exists()
    code, said = run("calibrate", recorded, "-o", tmp_path / "echo.nc")
    assert "nothing to calibrate by" in said
