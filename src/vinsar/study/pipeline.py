"""The engine of the chain: `run` takes a study through its stages in memory.

The stages are declared in the modules that compute them; the workflow takes each through a rule of
its own, with the same functions.
"""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING

from vinsar.foundations import variables
from vinsar.study.composition import STAGES
from vinsar.study.options import SIMULATION

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    import xarray as xr

    from vinsar.foundations.configuration import Study
    from vinsar.foundations.stage import Products, Stage

logger = logging.getLogger(__name__)

MEASURED = ("received", "trajectory", "recorded_trajectory")
"""Products that come from a file of measured echoes."""


def from_files(study: Study) -> tuple[str, ...]:
    """Return the products that a study takes from the user's files."""
    if study.measurement.file is not None:
        return MEASURED
    return ("elevation",) if study.scene.terrain == "file" else ()


def stages(study: Study) -> dict[str, Stage]:
    """Return the stages that a study has, in order.

    Those that its options ask for. Measured echoes come without the true scene: what is computed
    from it, or would compare with it, is left out.
    """
    wanted = {n: stage for n, stage in STAGES.items() if stage.when is None or stage.when(study)}
    if study.measurement.file is None:
        return wanted
    found: dict[str, Stage] = {}
    for name, stage in wanted.items():
        simulated = any(key.split(".")[0] in SIMULATION for key in stage.sections)
        known = set(stage.inputs) <= {*MEASURED, *found}
        if name not in MEASURED and known and not simulated:
            found[name] = stage
    return found


def run_stage(name: str, products: Mapping[str, xr.Dataset], study: Study) -> xr.Dataset:
    """Compute one stage.

    Parameters
    ----------
    name
        A key of `STAGES`.
    products
        The products that it reads, by name; others are not passed on.
    study
        The configuration.

    Returns
    -------
    xarray.Dataset
        The product of the stage's name.

    Raises
    ------
    ValueError
        If it has values that cannot be (`variables.refuse_values`).
    """
    stage = STAGES[name]
    logger.info("stage %s", name)
    inputs = {key: products[key] for key in stage.inputs}
    inputs |= {key: products[key] for key in stage.optional if key in products}
    return compute(name, inputs, study.part(study.values(stage.sections)))


def compute(name: str, inputs: Products, part: Study) -> xr.Dataset:
    """Compute one stage from no more than what it declares, and check what it delivers.

    Parameters
    ----------
    name
        A key of `STAGES`.
    inputs
        The products that it reads, by name.
    part
        The sections and keys that it reads.

    Returns
    -------
    xarray.Dataset
        The product of the stage's name.

    Raises
    ------
    ValueError
        If it has values that cannot be (`variables.refuse_values`).
    """
    product = STAGES[name].compute(inputs, part)
    variables.refuse_values(product, name, inputs)
    return product


def run(
    study: Study, only: str | None = None, given: Mapping[str, xr.Dataset] | None = None
) -> Products:
    """Take a study through all stages in memory.

    Parameters
    ----------
    study
        The configuration.
    only
        A product: compute no more than it needs.
    given
        Products that are there already, such as those from the user's files
        (`ingest.read`); they are not computed.

    Returns
    -------
    dict of xarray.Dataset
        Every product given and computed, by name.

    Raises
    ------
    KeyError
        If there is no such product.
    ValueError
        If a product from a file is not given.
    """
    products: Products = dict(given or {})
    missing = [name for name in from_files(study) if name not in products]
    if missing:
        raise ValueError(f"{', '.join(missing)} must be given: the study takes them from a file")
    waiting = {name: stage for name, stage in stages(study).items() if name not in products}
    for name in waiting if only is None else needed([only], waiting):
        products[name] = run_stage(name, products, study)
    return products


def needed(
    products: Iterable[str], available: Mapping[str, Stage] | None = None
) -> dict[str, Stage]:
    """Return the stages that some products need, their own included, in order.

    Parameters
    ----------
    products
        Names of products.
    available
        The stages there are, all of the chain by default; what none of them makes is there
        already.

    Returns
    -------
    dict of Stage
        The stages by name.

    Raises
    ------
    KeyError
        If none of them makes one of the products.
    """
    available = STAGES if available is None else available
    wanted: set[str] = set()

    def want(name: str) -> None:
        wanted.add(name)
        for source in (*available[name].inputs, *available[name].optional):
            if source in available:
                want(source)

    for product in products:
        want(product)
    return {name: stage for name, stage in available.items() if name in wanted}
