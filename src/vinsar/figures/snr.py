"""The spread of the height error against the signal-to-noise ratio."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from vinsar.figures.drawing import declaration, style, sweeps
from vinsar.foundations import variables
from vinsar.foundations.configuration import swept_section
from vinsar.foundations.constants import NORMAL_PER_MAD
from vinsar.radar import instrument, speckle

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from vinsar.foundations.configuration import Study
    from vinsar.foundations.stage import Products

_PARTS = (
    ("std", "whole_scene", 1.0, sweeps.WHOLE),
    ("std", "visible_ground", 1.0, sweeps.VISIBLE),
    ("mad", "visible_ground", NORMAL_PER_MAD, sweeps.CORE),
)


@style.styled
def draw(products: Products, study: Study) -> Figure:
    """Draw the spread of the height error against the signal-to-noise ratio.

    Parameters
    ----------
    products
        ``sweeps/snr``.
    study
        The configuration.

    Returns
    -------
    matplotlib.figure.Figure
        The figure.
    """
    sweep = variables.swept(products["sweeps/snr"], "echo_snr_db").sortby("echo_snr_db")
    ratio = sweep["echo_snr_db"].values
    radar = swept_section(study, "snr", "radar")
    scene = swept_section(study, "snr", "scene")
    place = instrument.middle(scene)
    planned = instrument.Instrument.planned(radar)
    filled = planned.filled(scene.x_min_m, scene.x_max_m, place[1])
    coherence = speckle.pixel_coherence(planned.geometric_coherence(*place), ratio, filled)
    per_radian = 100 * planned.height_of_ambiguity(*place) / (2 * np.pi)
    predicted, bound = (
        per_radian * std for std in sweeps.phase_std(study, "snr", planned, coherence)
    )
    figure = style.new_figure(style.ONE_COLUMN_MM, 95.0)
    axes = style.place(figure, 13.0, 37.0, 72.0, 52.0)
    values = []
    for name, region, scale, look in _PARTS:
        data = 100 * scale * sweep[name].sel(region=region)
        sweeps.curve(axes, ratio, data, look)
        values.append(data.values)
    handles, _ = axes.get_legend_handles_labels()
    handles.append(sweeps.band_patch())
    handles += axes.plot(
        ratio,
        predicted,
        color=style.GREY,
        linestyle="--",
        label="predicted, level ground",
    )
    handles.append(sweeps.draw_bound(axes, ratio, bound))
    random = 100 * float(planned.random_phase_std(*place))
    handles.append(
        axes.axhline(
            random,
            color=style.GREY,
            linestyle=":",
            linewidth=0.9,
            label=f"random phase: {random:.1f} cm",
        )
    )
    limits = sweeps.around(*values, predicted, bound, [random])
    sweeps.log_y(axes, limits)
    axes.xaxis.set_major_locator(style.round_ticks(7))
    axes.set_xlabel("signal-to-noise ratio of a range cell (dB)")
    axes.set_ylabel("height error (cm)")
    axes.set_title("Spread of the height error under thermal noise")
    sweeps.legend(figure, handles, 13.0, 2.0, 1)
    return figure


def numbers(products: Products, study: Study) -> str:
    """Return the spread at the lowest and the highest ratio, as a sentence."""
    del study
    sweep = variables.swept(products["sweeps/snr"], "echo_snr_db").sortby("echo_snr_db")
    mean = (
        100
        * sweeps.spread(
            sweep["std"].sel(region="whole_scene").transpose("echo_snr_db", "realization")
        )[0]
    )
    ratio = sweep["echo_snr_db"].values
    return (
        f"Mean spread over the whole scene: {mean[0]:.1f} cm at {ratio[0]:g} dB, {mean[-1]:.1f} cm "
        f"at {ratio[-1]:g} dB."
    )


FIGURES = {
    "snr": declaration.Figure(
        draw=draw,
        title="Thermal noise",
        caption=(
            "Height error against the signal-to-noise ratio of a range cell, with the noise that "
            "the looks of the phase filter leave of level ground, and the Cramér-Rao bound of as "
            "many looks."
        ),
        sections=("figures", "radar", "scene", "imaging", "filtering", "sweeps"),
        sweeps=("snr",),
        numbers=numbers,
    ),
}
