"""A study beside variants of itself: what other seeds, heights and choices do to the accuracy."""

from __future__ import annotations

from typing import TYPE_CHECKING

from vinsar.foundations import tables
from vinsar.study import pipeline, validation

if TYPE_CHECKING:
    from collections.abc import Mapping

    import xarray as xr

    from vinsar.foundations.configuration import Study


def evaluate(study: Study, given: Mapping[str, xr.Dataset] | None = None) -> dict[str, xr.Dataset]:
    """Run a study and its variants.

    Parameters
    ----------
    study
        The configuration, with its `variants`.
    given
        Products from the user's files, the same for all.

    Returns
    -------
    dict of xarray.Dataset
        Product ``accuracy`` of the study itself, named ``as configured``, and of each variant.

    Raises
    ------
    validation.ConfigurationError
        If anything is wrong with a variant; then none is run.
    """
    cases = {"as configured": study} | validation.variants(study)
    return {name: pipeline.run(case, "accuracy", given)["accuracy"] for name, case in cases.items()}


def as_markdown(results: dict[str, xr.Dataset]) -> str:
    """Return the accuracies as a Markdown table.

    Parameters
    ----------
    results
        Product ``accuracy`` by name.

    Returns
    -------
    str
        A row a variant: whole scene and visible ground; then the same of what is delivered.
    """
    tolerance = 100 * float(next(iter(results.values()))["tolerance"])
    within = f"within {tolerance:g} cm"
    rows = []
    for name, accuracy in results.items():
        scene, seen, shadow = (
            accuracy.sel(region=region) for region in ("whole_scene", "visible_ground", "shadow")
        )
        rows.append(
            (
                name,
                f"{100 * float(scene['fraction_within_tolerance']):.1f} %",
                f"{100 * float(scene['std']):.2f} cm",
                f"{float(scene['maximum_absolute']):.2f} m",
                f"{100 * float(seen['fraction_within_tolerance']):.1f} %",
                f"{100 * float(seen['std']):.2f} cm",
                f"{100 * float(shadow['cell_count']) / float(scene['cell_count']):.1f} %",
            )
        )
    headings = (
        *("variant", within, "std", "worst"),
        *(f"visible: {within}", "visible: std", "in shadow"),
    )
    return f"{tables.write(headings, rows, 'lrrrrrr')}\n\n{_delivered(results, within)}\n"


def _delivered(results: dict[str, xr.Dataset], within: str) -> str:
    """Return what each variant delivers, and what its standard deviations are worth."""
    rows = []
    for name, accuracy in results.items():
        part = accuracy.sel(region="delivered")
        by_std = 100 * accuracy["binned_coverage"]
        rows.append(
            (
                name,
                f"{100 * float(part['share_of_scene']):.1f} %",
                f"{100 * float(part['fraction_within_tolerance']):.2f} %",
                f"{100 * float(part['maximum_absolute']):.1f} cm",
                f"{100 * float(part['percentile_90_absolute']):.1f} cm",
                *(
                    f"{100 * float(part[f'coverage_{count}_sigma']):.1f} % "
                    f"({float(values.min()):.0f} to {float(values.max()):.0f})"
                    for count, values in by_std.groupby("sigmas")
                ),
                _percent(accuracy["hidden_delivered"]),
                _percent(accuracy["visible_withheld"]),
            )
        )
    headings = (
        *("variant", "delivered", within, "worst", "LE90"),
        *("within 1 std (by fifths)", "within 2 std", "hidden, delivered", "visible, not"),
    )
    return tables.write(headings, rows, "lrrrrrrrr")


def _percent(share: xr.DataArray) -> str:
    return f"{100 * float(share):.1f} %" if share.notnull() else "–"
