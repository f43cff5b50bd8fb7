"""Which choices give the paper's own figures: their distance from what was published.

The paper reports three numbers of one realization: the share of heights within 5 cm, their standard
deviation and the worst error. A choice is like the paper if these three could be a realization of
its own. The share enters as that beyond the tolerance, and all three by their logarithms, in which
realizations scatter alike from choice to choice.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from vinsar.foundations import tables
from vinsar.foundations.variables import COORDINATES
from vinsar.paper.claims import PAPER_STD_M

if TYPE_CHECKING:
    from collections.abc import Mapping

    import xarray as xr
    from numpy.typing import NDArray

    Floats = NDArray[np.floating]

SWEEPS = (
    *("rail_height", "frequency_count", "facet_size", "facet_jitter", "reflectivity", "noise"),
    *("range_window", "aperture_window", "grid_spacing"),
    *("goldstein_alpha", "goldstein_patch", "filter", "unwrapping", "reference"),
    *("patch_and_unwrapping", "rail_and_patch", "rail_and_noise", "rail_and_windows"),
)
"""Sweeps over choices that the paper leaves open."""

POSITION_ERRORS = "position_errors"
"""Sweep behind the statements of Fig. 5."""

STATISTICS = ("fraction_within_tolerance", "std", "maximum_absolute")
"""What the paper reports of its heights, whole scene."""

PUBLISHED = (0.95, PAPER_STD_M, 0.88)
"""Its figures: share, m, m (section 2.3)."""

PLATEAU_M = 0.043
"""Height std near which Fig. 5 fluctuates from two wavelengths on, m (section 2.4)."""

_LABELS = {
    "radar.rail_height_m": "rail {} m",
    "radar.frequency_count": "{} frequencies",
    "scene.facet_size_m": "facets {} m",
    "scene.facet_jitter": "jitter {}",
    "echo.reflectivity": "reflectivity as {}",
    "echo.snr_db": "SNR {} dB",
    "imaging.range_window": "range {}",
    "imaging.aperture_window": "aperture {}",
    "imaging.grid_spacing_m": "pixels {} m",
    "filtering.method": "filter {}",
    "filtering.goldstein_alpha": "alpha {}",
    "filtering.goldstein_patch_px": "patch {}",
    "unwrapping.method": "{}",
    "height.reference": "reference {}",
}

_LEAST_SHARE = 1e-4
_BOUND = 2.0

# Realizations with heights that a distance needs.
_LEAST = 2

# Share of the largest variance below which a combination of the statistics has none of its own.
_COLLINEAR = 1e-4


@dataclass(frozen=True)
class Choice:
    """A choice beside the published figures.

    Attributes
    ----------
    sweep
        Sweep that it is a case of.
    label
        Its keys and values.
    values
        `STATISTICS` by realization (realization, 3).
    deviations
        Published figures less the choice's mean, in standard deviations of its own realizations.
    distance
        Joint distance, in standard deviations: the Mahalanobis distance with the covariance that
        realizations have, pooled over all choices.
    distance_std
        Its standard deviation, jackknifed over the realizations.
    """

    sweep: str
    label: str
    values: Floats
    deviations: Floats
    distance: float
    distance_std: float

    @property
    def consistent(self) -> bool:
        """Whether each published figure is within two standard deviations."""
        return bool((np.abs(self.deviations) <= _BOUND).all())


def transformed(values: Floats) -> Floats:
    """Return the statistics (..., 3) as they are compared: logarithms, of the share its rest."""
    beyond, std, worst = np.moveaxis(np.asarray(values, float), -1, 0)
    beyond = np.maximum(1 - beyond, _LEAST_SHARE)
    return np.stack([np.log(beyond), np.log(std), np.log(worst)], axis=-1)


def compare(sweeps: Mapping[str, xr.Dataset]) -> list[Choice]:
    """Return all choices with their distance from the published figures.

    Parameters
    ----------
    sweeps
        Products ``sweep`` by name; `SWEEPS` among them.

    Returns
    -------
    list of Choice
        In the order of `SWEEPS` and of their values.

    Raises
    ------
    ValueError
        If a sweep has fewer than three realizations.
    """
    cases = [
        (name, label, values) for name in SWEEPS for label, values in _cases(name, sweeps[name])
    ]
    samples = [_known(transformed(values)) for _, _, values in cases]
    scatter = [np.cov(known, rowvar=False, ddof=1) for known in samples if len(known) > 2]
    covariance = np.mean(scatter, axis=0) if scatter else np.zeros((3, 3))
    target = transformed(np.array(PUBLISHED))
    # Statistics that always scatter together are one.
    inverse = np.linalg.pinv(covariance, rcond=_COLLINEAR, hermitian=True)

    def distance(sample: Floats) -> float:
        if len(sample) < _LEAST:
            return float("nan")
        away = target - sample.mean(axis=0)
        return float(np.sqrt(away @ inverse @ away))

    found = []
    for (name, label, values), sample in zip(cases, samples, strict=True):
        count = len(sample)
        enough = count > _LEAST
        left_out = [distance(np.delete(sample, number, axis=0)) for number in range(count)]
        unknown = np.full(3, np.nan)
        found.append(
            Choice(
                sweep=name,
                label=label,
                values=values,
                deviations=(target - sample.mean(axis=0)) / sample.std(axis=0, ddof=1)
                if enough
                else unknown,
                distance=distance(sample),
                distance_std=float(np.sqrt((count - 1) * np.var(left_out)))
                if enough
                else float("nan"),
            )
        )
    return found


def _known(sample: Floats) -> Floats:
    """Return the realizations that have heights."""
    return sample[np.isfinite(sample).all(axis=1)]


def _cases(name: str, sweep: xr.Dataset) -> list[tuple[str, Floats]]:
    """Return each case of a sweep: its label, and its statistics (realization, 3)."""
    if sweep.sizes["realization"] < 3:
        raise ValueError(f"the sweep '{name}' has fewer than three realizations")
    table = np.stack([sweep[key].sel(region="whole_scene").values for key in STATISTICS], axis=-1)
    keys = [str(dim) for dim in sweep["std"].dims if dim not in COORDINATES]
    found = []
    for index in np.ndindex(*(sweep.sizes[key] for key in keys)):
        parts = [
            _label(sweep[key].attrs["long_name"], sweep[key].values[at])
            for key, at in zip(keys, index, strict=True)
        ]
        found.append((", ".join(parts), table[index]))
    return found


def _label(key: str, value: object) -> str:
    """Return a choice in a few words: its key, and its value."""
    text = f"{value:g}" if isinstance(value, float | np.floating) else str(value)
    return _LABELS.get(key, f"{key} {{}}").format(
        text.replace("_", " ").replace("rectangular", "rect")
    )


def nearest(choices: list[Choice]) -> Choice:
    """Return the choice at the least distance."""
    return min(choices, key=lambda choice: np.nan_to_num(choice.distance, nan=np.inf))


def single(choices: list[Choice]) -> Choice:
    """Return the change of one key alone that comes nearest."""
    return nearest([choice for choice in choices if "," not in choice.label])


def position_errors(sweep: xr.Dataset) -> list[tuple[str, ...]]:
    """Return what Fig. 5 says beside what each choice gives.

    Parameters
    ----------
    sweep
        Product ``sweep`` of the name `POSITION_ERRORS`.

    Returns
    -------
    list of tuple of str
        Rows: unwrapper, mode, height std without errors; along y at one wavelength; along x, z at
        two; the plateau's distance from the published one in standard deviations.
    """
    rows: list[tuple[str, ...]] = []
    std = sweep["std"].sel(region="whole_scene")
    for method in sweep["unwrapping_method"].values:
        for mode in sweep["motion_channels"].values:
            case = std.sel(unwrapping_method=method, motion_channels=mode)
            at = {
                (axis, level): case.sel(motion_axis=axis, motion_level_wavelengths=level).values
                for axis in "xyz"
                for level in (0.0, 1.0, 2.0)
            }
            plateau = np.concatenate([at[axis, 2.0] for axis in "xyz"])
            away = (PLATEAU_M - plateau.mean()) / plateau.std(ddof=1)
            rows.append(
                (
                    f"{method}, {mode}",
                    f"{100 * at['y', 0.0].mean():.1f} cm",
                    f"{100 * at['y', 1.0].mean():.1f} cm",
                    f"{100 * at['x', 2.0].mean():.1f} cm",
                    f"{100 * at['z', 2.0].mean():.1f} cm",
                    f"{away:+.1f}",
                )
            )
    return rows


def conclusion(choices: list[Choice]) -> str:
    """Return what follows, in a few sentences."""
    if all(np.isnan(choice.distance) for choice in choices):
        return "No choice tried has heights."
    like = [choice for choice in choices if choice.consistent]
    best, alone = nearest(choices), single(choices)
    share, std, worst = (float(np.nanmean(part)) for part in best.values.T)
    text = (
        "No choice tried is within two standard deviations of all three published figures."
        if not like
        else "Within two standard deviations of all three published figures: "
        + "; ".join(choice.label for choice in like)
        + "."
    )
    return (
        f"{text} Nearest is {best.label}: {100 * share:.1f} % within 5 cm, standard deviation "
        f"{100 * std:.1f} cm, worst error {worst:.2f} m, {best.distance:.1f} standard deviations "
        f"away (± {best.distance_std:.1f}). The one key that explains most is {alone.label} "
        f"({alone.distance:.1f} ± {alone.distance_std:.1f})."
    )


def as_markdown(sweeps: Mapping[str, xr.Dataset]) -> str:
    """Return the conclusion, the choices and Fig. 5's statements as Markdown.

    Parameters
    ----------
    sweeps
        Products ``sweep`` by name; `SWEEPS` and `POSITION_ERRORS`.
    """
    choices = compare(sweeps)
    rows = []
    for choice in choices:
        share, std, worst = choice.values.mean(axis=0)
        share_sd, std_sd, worst_sd = choice.values.std(axis=0, ddof=1)
        rows.append(
            (
                choice.label,
                f"{100 * share:.1f} ± {100 * share_sd:.1f} %",
                f"{100 * std:.2f} ± {100 * std_sd:.2f} cm",
                f"{worst:.2f} ± {worst_sd:.2f} m",
                " / ".join(f"{part:+.1f}" for part in choice.deviations),
                f"{choice.distance:.1f} ± {choice.distance_std:.1f}",
                "yes" if choice.consistent else "no",
            )
        )
    share, std, worst = PUBLISHED
    published = (f"{100 * share:g} %", f"{100 * std:g} cm", f"{worst:g} m")
    head = ("choice", "within 5 cm", "std", "worst", "deviations", "distance", "consistent")
    fig5 = ("unwrapper, mode", "no errors", "y, 1 λ", "x, 2 λ", "z, 2 λ", "from the plateau")
    return "\n".join(
        [
            conclusion(choices),
            "",
            tables.write(head, [("published", *published, "", "", ""), *rows], "lrrrrrl"),
            "",
            f"Fig. 5: along y heights fail from one wavelength on, along x and z two are borne, "
            f"and the spread fluctuates near {100 * PLATEAU_M:g} cm.",
            "",
            tables.write(fig5, position_errors(sweeps[POSITION_ERRORS]), "lrrrrr"),
            "",
        ]
    )
