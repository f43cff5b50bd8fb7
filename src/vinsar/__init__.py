"""Vehicle-mounted forward-looking interferometric SAR, from radar echoes to terrain height.

What a notebook needs: `load` a study, `run` it or a part of it, `sweep` over its keys, `read`
products that a run has left in files, `draw` figures. A product is a labelled `xarray.Dataset`.

Examples
--------
The paper's study on a coarser grid, from echoes to heights and their errors:

>>> import vinsar
>>> study = vinsar.load(imaging={"grid_spacing_m": 0.05}, radar={"rail_height_m": 1.8})
>>> products = vinsar.run(study, "accuracy")
>>> float(products["accuracy"]["std"].sel(region="whole_scene"))  # doctest: +SKIP
0.02
>>> vinsar.draw("fig4", products, study)  # doctest: +SKIP
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from vinsar._version import __version__

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    import matplotlib.figure
    import xarray as xr

    from vinsar.foundations.configuration import Study

__all__ = ["__version__", "draw", "load", "read", "run", "sweep"]


def load(*files: str | Path, **changes: Any) -> Study:
    """Return a study: the paper's, but for what files and keywords change.

    Parameters
    ----------
    files
        YAML files, each overriding the ones before it.
    changes
        Sections and keys that override the files, such as ``radar={"baseline_m": 0.25}``.

    Returns
    -------
    Study
        The checked configuration; if it names measured echoes, with the radar of their file.

    Raises
    ------
    ConfigurationError
        If anything is wrong with it, all in one message; a `ValueError`.
    ValueError
        If a file cannot be read as YAML.
    """
    from importlib import resources

    from vinsar.study import ingest, validation

    with resources.as_file(resources.files("vinsar.paper") / "paper.yaml") as paper:
        raw = validation.read(paper, *files)
    return ingest.check(validation.merge(raw, changes))


def run(
    study: Study, *products: str, given: Mapping[str, xr.Dataset] | None = None
) -> dict[str, xr.Dataset]:
    """Take a study through its stages in memory.

    Parameters
    ----------
    study
        The study.
    products
        Products wanted, such as ``"dem"``: no more is computed than they need; all if left out.
    given
        Products that are there already, such as those of an earlier call; they are not computed.

    Returns
    -------
    dict of xarray.Dataset
        Every product given and computed, by name.

    Raises
    ------
    ValueError
        If the study has no such product, or a file that it takes products from is wrong.
    """
    from vinsar.study import ingest, pipeline

    known = ingest.read(study) | dict(given or {})
    there = pipeline.stages(study)
    for name in products:
        if name not in there and name not in known:
            raise ValueError(f"the study has no product '{name}'; it has {', '.join(there)}")
    for wanted in products or (None,):
        # The one before may have needed it.
        if wanted not in known:
            known = pipeline.run(study, wanted, known)
    return known


def sweep(study: Study, name: str, *, threads: int = 1) -> xr.Dataset:
    """Run one of a study's sweeps in memory.

    Parameters
    ----------
    study
        The study; its section ``sweeps`` has the sweep.
    name
        Name of the sweep.
    threads
        How many cases run at once.

    Returns
    -------
    xarray.Dataset
        Statistics of the height error by swept key, realization and region.

    Raises
    ------
    ValueError
        If there is no such sweep, or a case of it is not a valid study; nothing has run then.
    SweepError
        If cases raised, naming them.
    """
    from vinsar.study import ingest
    from vinsar.study.options import Dask
    from vinsar.sweeps import cluster
    from vinsar.sweeps import sweep as sweeps

    if name not in study.sweeps:
        raise ValueError(f"the study has no sweep '{name}'; it has {', '.join(study.sweeps)}")
    with cluster.workers(Dask(scheduler="threads", address=None), threads) as compute:
        return sweeps.run(study, name, compute=compute, given=ingest.read(study))


def read(path: str | Path) -> xr.Dataset:
    """Read a product that a run of the workflow has left in a netCDF file.

    Parameters
    ----------
    path
        The file, such as ``results/paper/dem.nc``; a sweep's too.

    Returns
    -------
    xarray.Dataset
        The product, complex and with its labels; its provenance is in the attributes.

    Raises
    ------
    ValueError
        If the file is missing, truncated, not netCDF, or no product.
    """
    from vinsar.results import storage
    from vinsar.study import composition
    from vinsar.sweeps import sweep as sweeps

    del composition, sweeps  # They declare the products there are.
    return storage.read(path)


def draw(name: str, products: Mapping[str, xr.Dataset], study: Study) -> matplotlib.figure.Figure:
    """Draw one of the figures; a notebook shows what is returned.

    Parameters
    ----------
    name
        Name of the figure, a key of `vinsar.figures.FIGURES`.
    products
        Products by name, sweeps as ``sweeps/<name>``; the figure takes those that it reads.
    study
        The study.

    Returns
    -------
    matplotlib.figure.Figure
        The figure.

    Raises
    ------
    ValueError
        If there is no such figure, or a product that it reads is not given.
    """
    from vinsar import figures

    if name not in figures.FIGURES:
        raise ValueError(f"no figure '{name}'; there are {', '.join(figures.FIGURES)}")
    figure = figures.FIGURES[name]
    missing = [product for product in figure.reads if product not in products]
    if missing:
        raise ValueError(f"the figure '{name}' reads {', '.join(missing)}, not given")
    return figures.shown_inline(figure.draw({key: products[key] for key in figure.reads}, study))
