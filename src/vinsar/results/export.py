"""A simulated echo in the form of a measurement, to be read back as one."""

from __future__ import annotations

from pathlib import Path

from vinsar.foundations import variables
from vinsar.results import storage


def measurement(folder: str | Path, path: str | Path) -> None:
    """Write a study's simulated echo in the form of a measurement.

    Parameters
    ----------
    folder
        The study's folder.
    path
        The file; it appears whole or not at all.

    Raises
    ------
    ValueError
        If the study has not been run.
    """
    received = storage.read(Path(folder) / "received.nc", "received")
    antennas = storage.read(Path(folder) / "recorded_trajectory.nc", "recorded_trajectory")
    data = variables.dataset(
        "measurement",
        {"echo": received["echo"].values}
        | {name: antennas[name].values for name in ("transmitter", "receiver")},
        {"frequency": received["frequency"].values},
    )
    title = f"echo of the study {received.attrs['vinsar_study']}, simulated"
    storage.write(data, path, "measurement", {"title": title, "source": received.attrs["source"]})
