"""The height noise that sweeps measured against what the design sheet predicts."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from vinsar.figures.design import OF_AXES, changed
from vinsar.figures.drawing import declaration, style, sweeps
from vinsar.foundations import variables
from vinsar.foundations.configuration import swept_section
from vinsar.foundations.constants import AXES, NORMAL_PER_MAD
from vinsar.prediction import design
from vinsar.radar import trajectory

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from vinsar.foundations.configuration import Study
    from vinsar.foundations.stage import Products

    Floats = NDArray[np.floating]

# Noise below which the phase unwraps, m.
_UNWRAPS_M = 0.05


@style.styled
def draw(products: Products, study: Study) -> Figure:
    """Draw the height noise that sweeps measured against what was predicted.

    Parameters
    ----------
    products
        ``sweeps/snr``, ``sweeps/baseline_length`` and ``sweeps/vibration``.
    study
        The configuration.

    Returns
    -------
    matplotlib.figure.Figure
        The figure.
    """
    figure = style.new_figure(style.ONE_COLUMN_MM, 103.0)
    axes = style.place(figure, 13.0, 28.0, 69.0, 69.0)
    handles: list[Any] = []
    everything: list[Floats] = []
    for label, (predicted, measured), colour, marker in _cases(products, study):
        handles += axes.plot(
            100 * predicted,
            100 * measured,
            color=colour,
            linestyle="none",
            marker=marker,
            markersize=3.5,
            markerfacecolor="white",
            markeredgewidth=0.8,
            label=label,
        )
        everything += [100 * predicted, 100 * measured]
    limits = sweeps.around(*everything)
    line = np.array(limits)
    handles += axes.plot(line, line, color=style.GREY, linewidth=0.8, label="equal")
    for factor, name in ((2.5, "factor of 2.5"), (0.4, "")):
        drawn = axes.plot(
            line, factor * line, color=style.GREY, linestyle=":", linewidth=0.8, label=name
        )
        handles += drawn if name else []
    sweeps.log_x(axes, limits)
    sweeps.log_y(axes, limits)
    axes.set_xlabel("predicted height std (cm)")
    axes.set_ylabel("measured, 1.48 MAD on visible ground (cm)")
    axes.set_title("Predicted and measured height noise")
    sweeps.legend(figure, handles, 8.0, 2.0, 2)
    return figure


def numbers(products: Products, study: Study) -> str:
    """Return how far measured and predicted noise differ where the phase unwraps, as a sentence."""
    cases = [found for _, found, _, _ in _cases(products, study)]
    predicted, measured = (np.concatenate(parts) for parts in zip(*cases, strict=True))
    low = (predicted < _UNWRAPS_M) & np.isfinite(measured)
    if not low.any():
        return ""
    ratio = np.sort(measured[low] / predicted[low])
    most = f", {ratio[-2]:.2g} but for one" if ratio.size > 2 else ""
    return (
        f"Of {ratio.size} cases that are predicted below {100 * _UNWRAPS_M:g} cm the measured "
        f"noise is {ratio[0]:.2g} to {ratio[-1]:.2g} times the predicted one{most}."
    )


def _cases(products: Products, study: Study) -> list[tuple[str, tuple[Floats, Floats], str, str]]:
    """Return name, predicted and measured noise (case,) in m, colour and marker of each sweep."""
    return [
        ("signal-to-noise ratio", _by_noise(products, study), style.BLUE, "o"),
        ("length of the baseline", _by_baseline(products, study), style.ORANGE, "s"),
        *(
            (f"position errors along {name}", found, colour, "^v>"[AXES.index(name)])
            for name, found, colour in _by_errors(products, study)
        ),
    ]


def _sheet(study: Study, sweep: str, **changes: dict[str, Any]) -> design.Sheet:
    parts = {name: swept_section(study, sweep, name) for name in design.SECTIONS}
    return changed(parts, **changes)


def _spread(sweep: Any) -> Floats:
    measured = sweep["mad"].sel(region="visible_ground").mean("realization")
    return np.asarray(NORMAL_PER_MAD * measured.values)


def _by_noise(products: Products, study: Study) -> tuple[Floats, Floats]:
    sweep = variables.swept(products["sweeps/snr"], "echo_snr_db")
    levels = [None if np.isnan(v) else float(v) for v in sweep["echo_snr_db"].values]
    predicted = [_sheet(study, "snr", echo={"snr_db": v}).scene_height_std() for v in levels]
    return np.array(predicted), _spread(sweep)


def _by_baseline(products: Products, study: Study) -> tuple[Floats, Floats]:
    sweep = variables.swept(products["sweeps/baseline_length"], "radar_baseline_m")
    kept = swept_section(study, "baseline_length", "radar").baselines_m
    predicted = [
        _sheet(
            study, "baseline_length", radar=trajectory.longest(float(length), kept)
        ).scene_height_std()
        for length in sweep["radar_baseline_m"].values
    ]
    return np.array(predicted), _spread(sweep)


def _by_errors(products: Products, study: Study) -> list[tuple[str, tuple[Floats, Floats], str]]:
    keys = ("motion_channels", "motion_axis", "motion_level_wavelengths")
    sweep = variables.swept(products["sweeps/vibration"], *keys)
    sheet = _sheet(study, "vibration")
    found = []
    for axis, (name, (_, colour, _)) in enumerate(zip(AXES, OF_AXES, strict=True)):
        if (
            not {"independent"} <= set(sweep["motion_channels"].values)
            or name not in sweep["motion_axis"]
        ):
            continue
        part = sweep.sel(motion_channels="independent", motion_axis=name)
        predicted = [
            sheet.scene_height_std(axis, float(level) * sheet.instrument.wavelength)
            for level in part["motion_level_wavelengths"].values
        ]
        found.append((name, (np.array(predicted), _spread(part)), colour))
    return found


FIGURES = {
    "design_check": declaration.Figure(
        draw=draw,
        title="Prediction and measurement",
        caption=(
            "Height noise measured by the sweeps against its prediction. Where the phase no "
            "longer unwraps (the longest baselines, large position errors along y) the "
            "measured spread leaves the prediction."
        ),
        sections=("figures", "sweeps", *design.SECTIONS),
        sweeps=("snr", "baseline_length", "vibration"),
        numbers=numbers,
    ),
}
