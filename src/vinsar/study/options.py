"""Sections of a study as a whole: measured echoes, figures, outputs, sweeps and where they run."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import Field

from vinsar.foundations import colormaps
from vinsar.foundations.configuration import Section, key
from vinsar.foundations.errors import Fault

if TYPE_CHECKING:
    from collections.abc import Iterator


class Reflector(Section):
    """A reflector whose place was surveyed."""

    x_m: float = key("its place", "ours")
    y_m: float = key("its place", "ours")
    height_m: float = key("height of its phase centre above the ground plane", "ours")


class Measurement(Section, name="measurement"):
    """Your own echoes in place of simulated ones (docs/own-data.md)."""

    file: str | None = key(
        "netCDF file of measured echoes; paths begin in the repository's folder. The section "
        "`radar` then comes from the file; `scene`, `echo` and `motion` mean nothing",
        "ours",
    )
    channels: int | None = key(
        "how many channels the file has; read from it, whatever is given here", "ours", ge=1
    )
    reflectors: Annotated[tuple[Reflector, ...], Field(strict=False)] = key(
        "surveyed reflectors, which are measured in the images", "ours"
    )


class Figures(Section, name="figures"):
    """How figures look; nothing here changes a number."""

    height_colormap: str = key("colour map of heights, truth and reconstruction alike", "Fig. 3")
    phase_colormap: str = key("cyclic colour map of wrapped phases", "Fig. 3")
    amplitude_range_db: float = key("dynamic range of the images", "Fig. 3", gt=0)
    one_column_mm: float = key(
        "width of the figures of one column; the height goes with it", "not given", ge=70, le=140
    )
    two_columns_mm: float = key(
        "width of the figures of two columns; the height goes with it", "not given", ge=140, le=280
    )
    font_size_pt: float = key("size of the figures' text at any width", "not given", ge=5, le=12)
    font: Literal["sans", "serif"] = key(
        "DejaVu Sans or STIX, which is like Times; files embed it", "not given"
    )
    formats: Annotated[
        tuple[Literal["pdf", "svg", "png"], ...], Field(strict=False, min_length=1)
    ] = key("files of each figure; the reports show the PNG", "not given")
    png_dpi: int = key("resolution of the PNG files", "not given", ge=50, le=1200)


class Outputs(Section, name="outputs"):
    """What `./run` makes besides the products of the chain."""

    figures: Annotated[tuple[str, ...], Field(strict=False)] = key(
        "names of the figures; the sweeps that they show are run with them", "ours"
    )
    claims: bool = key("hold the study against the paper's claims", "ours")


Override = dict[str, Any]


class Sweep(Section):
    """A sweep over keys of the configuration."""

    over: dict[str, Annotated[tuple[Any, ...], Field(strict=False, min_length=1)]] = key(
        "values by dotted key, such as `radar.baseline_m`; the product of all lists is swept",
        "ours",
        min_length=1,
    )
    realizations: int = key(
        "independent repetitions of each case: other speckle, noise and errors", "ours", ge=1
    )
    base: Override = key("overrides that hold for all of its cases", "ours")


class Dask(Section, name="dask"):
    """Where sweeps run."""

    scheduler: Literal["threads", "processes"] = key(
        "workers of this machine: threads share what they have computed, processes survive a "
        "crash of one",
        "ours",
    )
    address: str | None = key(
        "address of a Dask scheduler that runs them instead; null for Dask's own configuration "
        "(DASK_SCHEDULER_ADDRESS) or this machine",
        "ours",
    )


def _colormaps(figures: Figures) -> Iterator[Fault]:
    for map_key in ("height_colormap", "phase_colormap"):
        name = getattr(figures, map_key)
        try:
            colormaps.find(name)
        except ValueError as error:
            yield Fault(f"figures.{map_key}", name, str(error))


def _text_fits(figures: Figures) -> Iterator[Fault]:
    # The figures are laid out for text of 7.5 pt on 88 and 180 mm, with some room to spare.
    widths = {"one_column_mm": 88.0, "two_columns_mm": 180.0}
    most = min(8.0 * getattr(figures, key) / laid_out for key, laid_out in widths.items())
    if figures.font_size_pt > most * (1 + 1e-9):
        yield Fault(
            "figures.font_size_pt",
            figures.font_size_pt,
            f"must be at most {most:.2f} for figures {figures.one_column_mm:g} and "
            f"{figures.two_columns_mm:g} mm wide, or their text would overlap",
        )


def _figure_files(figures: Figures) -> Iterator[Fault]:
    if "png" not in figures.formats:
        yield Fault("figures.formats", figures.formats, "must hold png, which the reports show")
    if len(set(figures.formats)) < len(figures.formats):
        yield Fault("figures.formats", figures.formats, "must hold each format once")


CHECKS = (_colormaps, _text_fits, _figure_files)

SIMULATION = ("scene", "echo", "motion")
"""Sections that mean nothing to measured echoes."""
