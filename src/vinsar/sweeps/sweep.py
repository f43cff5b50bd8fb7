"""Sweeps: every combination of keys of the configuration, each repeated, on Dask.

A case is a study. What its stages have in common with another case is computed once: a stage's
product is kept under its name, the keys of the configuration that it declares, and its inputs, by
channel where the stage works by channel. Nothing here knows what is swept.
"""

from __future__ import annotations

import hashlib
import json
import logging
import threading
from collections import Counter, OrderedDict
from concurrent.futures import Future
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from vinsar.evaluation import accuracy, detection_accuracy, point_response
from vinsar.foundations import blocks, variables
from vinsar.foundations.configuration import Study, swept_section
from vinsar.foundations.constants import CHANNELS, REGIONS
from vinsar.foundations.errors import ConfigurationError, Fault
from vinsar.foundations.variables import Variable
from vinsar.study import pipeline, validation
from vinsar.study.composition import StudyModel

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from numpy.typing import NDArray

    from vinsar.foundations.stage import Products, Stage
    from vinsar.simulation.scene import Scene
    from vinsar.study.options import Sweep

    Row = dict[str, Any]
    Results = tuple[dict[str, Row], dict[str, str]]
    # Products by name, each with what tells it from others.
    Given = Mapping[str, tuple[xr.Dataset, str]]
    Compute = Callable[
        [
            Callable[[list["Case"]], Results],
            list[list["Case"]],
            Callable[[Results], None],
            Callable[[list["Case"], str], None],
        ],
        None,
    ]

logger = logging.getLogger(__name__)

# What the stages of each case say.
_stages_logger = logging.getLogger("vinsar.processing")

_JUDGED = ("hidden_delivered", "visible_withheld")

SWEEP: dict[str, Variable] = {
    name: variable
    for name, variable in accuracy.VARIABLES.items()
    if variable.dims == ("region",) and name != "cell_count"
} | {
    **{name: accuracy.VARIABLES[name] for name in _JUDGED},
    "coherence": Variable((), "real", "1", "median coherence on visible ground"),
    "residues": Variable((), "integer", "1", "residues of the filtered phase"),
    **point_response.VARIABLES,
}
"""Variables of a sweep; the dimensions of the swept keys and of the realization come first."""

SWEEP_OF_OBJECTS: dict[str, Variable] = SWEEP | detection_accuracy.VARIABLES
"""Variables of a sweep over a scene with objects."""

CASES_PER_BLOCK = 15
"""Cases that a worker takes at a time, and at most loses when it dies."""

# Fewer cases a block where there are few, so that every worker has work to the end.
_LEAST_BLOCKS = 64

# Products up to this size are told apart by their numbers, which costs 0.1 ms at most: what comes
# out alike for other keys (positions without errors, one channel's antennas) is then known to be.
# Larger ones, images above all, are told apart by what they were made from.
_SMALL_BYTES = 1 << 16

_RESULTS = ("accuracy", "interferogram", "unwrapped", "focus", "truth")
_OF_OBJECTS = "detection_accuracy"
_STATISTICS = tuple(name for name, own in SWEEP.items() if own.dims == ("region",))
# Units by the ends of keys; UDUNITS knows the decibel by this name alone.
UNITS = {
    "m_per_s": "m s-1", "m": "m", "s": "s", "hz": "Hz", "db": "0.1 lg(re 1)", "deg": "degree",
}  # fmt: skip


class SweepError(RuntimeError):
    """Cases that raised; those that finished are kept."""


@dataclass(frozen=True, slots=True)
class Case:
    """One study of a sweep.

    Attributes
    ----------
    index
        Place along each swept key, and the realization last.
    changes
        Swept key and its value.
    first
        The study of realization 0, which all realizations share.
    key
        Digest of all that the case depends on in the configuration.
    """

    index: tuple[int, ...]
    changes: dict[str, Any]
    first: Study
    key: str

    @property
    def study(self) -> Study:
        """The study."""
        return self.first.model_copy(update={"realization": self.index[-1]})

    def __str__(self) -> str:
        values = ", ".join(f"{key} = {value}" for key, value in self.changes.items())
        return f"{values}, realization {self.index[-1]}"


def _digest(*parts: str | bytes) -> str:
    digest = hashlib.blake2b(digest_size=16)
    for part in parts:
        digest.update(part.encode() if isinstance(part, str) else part)
        digest.update(b"\0")
    return digest.hexdigest()


def _text(value: Any) -> str:
    return json.dumps(value, sort_keys=True, default=str)


def results(study: Study, name: str) -> tuple[str, ...]:
    """Return the products that a sweep's cases are judged by.

    Parameters
    ----------
    study
        The study that the sweep belongs to.
    name
        Name of the sweep.

    Returns
    -------
    tuple of str
        Names of products; how well objects are found is among them if the scene has any.
    """
    return _judged_by(swept_section(study, name, "scene"))


def _judged_by(scene: Scene) -> tuple[str, ...]:
    return (*_RESULTS, _OF_OBJECTS) if scene.objects else _RESULTS


def _stages(study: Study, name: str) -> dict[str, Stage]:
    return pipeline.needed(results(study, name))


def declared(study: Study, name: str) -> list[str]:
    """Return every key of the configuration that the stages of a sweep's cases declare.

    Parameters
    ----------
    study
        The study that the sweep belongs to.
    name
        Name of the sweep.

    Returns
    -------
    list of str
        Sections and single keys.
    """
    stages = _stages(study, name).values()
    return list(dict.fromkeys(key for stage in stages for key in stage.sections))


def studies(study: Study, name: str) -> list[tuple[dict[str, Any], Study]]:
    """Return a sweep's studies, all checked, each with its swept keys and their values.

    Parameters
    ----------
    study
        The study that the sweep belongs to.
    name
        Name of the sweep.

    Returns
    -------
    list of tuple
        The product of the swept values, the last key fastest.

    Raises
    ------
    validation.ConfigurationError
        If a swept key changes nothing, or one of them is not a valid study.
    """
    _refuse_idle(study, name)
    return [
        (changes, _share(case, study)) for changes, case in validation.sweep_studies(study, name)
    ]


def cases(study: Study, name: str, *given: str) -> list[Case]:
    """Return a sweep's cases, those that share their first stages next to each other.

    Parameters
    ----------
    study
        The study that the sweep belongs to.
    name
        Name of the sweep.
    *given
        What tells the products from files from others.

    Returns
    -------
    list of Case
        The product of the swept values and the realizations.

    Raises
    ------
    validation.ConfigurationError
        If a swept key changes nothing, or any case is not a valid study; nothing has run then.
    """
    sweep = study.sweeps[name]
    names = declared(study, name)
    shape = [len(values) for values in sweep.over.values()]
    sections = [stage.sections for stage in _stages(study, name).values()]
    realizations = np.arange(sweep.realizations)
    # What the first stages read changes slowest, so that few of their products are kept at a time.
    seen: list[dict[str, int]] = [{} for _ in sections]
    found, ranks = [], []
    # The last key slowest: cases that one of its values makes alike (no error, along any axis) and
    # channels that others share come together, too.
    every = sorted(
        zip(np.ndindex(*shape), studies(study, name), strict=True), key=lambda one: one[0][::-1]
    )
    for index, (changes, case) in every:
        values = case.values(names) | {"realization": None}
        whole = _text(values)
        for realization in range(sweep.realizations):
            key = _digest(whole, str(realization), *given)
            found.append(Case((*index, realization), changes, case, key))
        rank = np.empty((len(sections), sweep.realizations), int)
        for place, (known, part) in enumerate(zip(seen, sections, strict=True)):
            text = _text({key: values[key] for key in part})
            rank[place] = known.setdefault(text, len(known)) * sweep.realizations
            if "realization" in part:
                rank[place] += realizations
        ranks.append(rank)
    order = np.lexsort(np.concatenate(ranks, axis=1)[::-1])
    return [found[place] for place in order]


def _refuse_idle(study: Study, name: str) -> None:
    """Refuse swept keys that no stage of a case reads, and values that are listed twice."""
    faults = []
    read = [f"{key}." for key in declared(study, name)]
    for key, values in study.sweeps[name].over.items():
        where = f"sweeps.{name}.over.{key}"
        if key == "realization":
            advice = f"is counted by sweeps.{name}.realizations; take it out of `over`"
            faults.append(Fault(where, None, advice))
        elif key == "scene.objects":
            advice = (
                "must be the same in all cases; put them into scene.objects or the sweep's base"
            )
            faults.append(Fault(where, None, advice))
        # A key that is not there at all is for the check of the cases, which says what was meant.
        elif key in validation.every_key() and not any(
            f"{key}.".startswith(part) or part.startswith(f"{key}.") for part in read
        ):
            advice = "no stage of a case reads it, so all its values would give the same result"
            faults.append(Fault(where, None, advice))
        for other in study.sweeps[name].over:
            if f"{key}.".startswith(f"{other}.") and key != other:
                advice = f"is within {other}, which is swept as well: one would hide the other"
                faults.append(Fault(where, None, advice))
        count = Counter(_text(_number_by_value(value)) for value in values)
        twice = [text for text, times in count.items() if times > 1]
        if twice:
            faults.append(Fault(where, ", ".join(twice), "is listed more than once"))
    if faults:
        raise ConfigurationError(faults)


def _number_by_value(value: Any) -> Any:
    """Return a value in which equal numbers look alike: 1 and 1.0, 0.0 and -0.0."""
    if isinstance(value, dict):
        return {key: _number_by_value(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [_number_by_value(part) for part in value]
    return float(value) + 0.0 if _is_number(value) else value


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _share(case: Study, study: Study) -> Study:
    """Return a case that holds the study's own sections where they are equal: less memory."""
    same = {name: getattr(study, name) for name in type(study).model_fields}
    return case.model_copy(
        update={name: part for name, part in same.items() if getattr(case, name) == part}
    )


class _Product:
    """A stage's product with what tells it from others, whole and by channel."""

    def __init__(self, name: str, parts: list[tuple[xr.Dataset, str]]) -> None:
        self.name, self.parts = name, parts
        self._whole: tuple[xr.Dataset, str] | None = None
        self._channels: list[tuple[xr.Dataset, str]] | None = None

    def whole(self) -> tuple[xr.Dataset, str]:
        if self._whole is None:
            whole = self.parts[0]
            if len(self.parts) > 1:
                joined = _join_channels(self.name, [part for part, _ in self.parts])
                whole = joined, _digest(*(name for _, name in self.parts))
            self._whole = whole
        return self._whole

    def names(self) -> list[str]:
        parts = [data["channel"].values for data, _ in self.parts if "channel" in data.dims]
        return [str(label) for labels in parts for label in labels]

    def channel(self, index: int) -> tuple[xr.Dataset, str]:
        if len(self.parts) > 1:
            return self.parts[index]
        data, name = self.parts[0]
        if "channel" not in data.dims:
            return self.parts[0]
        if self._channels is None:
            labels = [str(label) for label in data["channel"].values]
            split = [_split_channel(data, n) for n in range(len(labels))]
            self._channels = [
                (part, _identity(part, _digest(name, label)))
                for part, label in zip(split, labels, strict=True)
            ]
        return self._channels[index]


class Memo:
    """Products of stages, the latest of each stage, shared by the threads of a process.

    Parameters
    ----------
    capacity
        How many products of a stage (and channel) are kept, at least; as many threads as ever work
        at once have two each.

    Attributes
    ----------
    computed
        How often each stage (and channel) has been computed.
    """

    def __init__(self, capacity: int = 4) -> None:
        self._capacity = capacity
        self._active = 0
        self._lock = threading.Lock()
        self._kept: dict[str, OrderedDict[str, Future[_Product]]] = {}
        self.computed: dict[str, int] = {}

    def kept(self) -> dict[str, int]:
        """Return how many products of each stage (and channel) are kept."""
        with self._lock:
            return {name: len(products) for name, products in self._kept.items()}

    def products(self, names: Iterable[str], study: Study, given: Given | None = None) -> Products:
        """Return products for a study, computing only what is neither given nor kept."""
        with self._lock:
            self._active += 1
            self._capacity = max(self._capacity, 2 * self._active)
        try:
            return self._products(tuple(names), study, given or {})
        finally:
            with self._lock:
                self._active -= 1

    def _products(self, wanted: tuple[str, ...], study: Study, given: Given) -> Products:
        made = {name: _Product(name, [product]) for name, product in given.items()}
        stages = pipeline.needed(wanted, pipeline.stages(study))
        values = study.values({name for stage in stages.values() for name in stage.sections})
        for name, stage in stages.items():
            setting = {key: values[key] for key in stage.sections}
            text = _text(setting)
            compute = partial(_compute, name, setting)
            inputs = {key: made[key] for key in stage.inputs}
            inputs |= {key: made[key] for key in stage.optional if key in made}
            if stage.by_channel:
                made[name] = _Product(
                    name,
                    [
                        self._get(
                            f"{name}/{label}",
                            text,
                            {key: product.channel(index) for key, product in inputs.items()},
                            compute,
                        ).parts[0]
                        for index, label in enumerate(_channels(inputs.values()))
                    ],
                )
            else:
                whole = {key: product.whole() for key, product in inputs.items()}
                made[name] = self._get(name, text, whole, compute)
        return {name: made[name].whole()[0] for name in wanted}

    def _get(
        self,
        name: str,
        setting: str,
        inputs: Mapping[str, tuple[xr.Dataset, str]],
        compute: Callable[[Products], xr.Dataset],
    ) -> _Product:
        key = _digest(name, setting, *(origin for _, origin in inputs.values()))
        with self._lock:
            kept = self._kept.setdefault(name, OrderedDict())
            future = kept.get(key)
            mine = future is None
            if future is None:
                future = kept[key] = Future()
                self.computed[name] = self.computed.get(name, 0) + 1
                while len(kept) > self._capacity:
                    kept.popitem(last=False)
            else:
                kept.move_to_end(key)
        if mine:
            try:
                product = compute({label: data for label, (data, _) in inputs.items()})
                future.set_result(_Product(name, [(product, _identity(product, key))]))
            except BaseException as error:
                with self._lock:
                    kept.pop(key, None)
                future.set_exception(error)
        return future.result()


def _channels(products: Iterable[_Product]) -> list[str]:
    return next(filter(None, (product.names() for product in products)))


def _compute(name: str, setting: dict[str, Any], products: Products) -> xr.Dataset:
    return pipeline.compute(name, products, StudyModel.part(setting))


def _split_channel(product: xr.Dataset, number: int) -> xr.Dataset:
    return product.isel(channel=slice(number, number + 1)) if "channel" in product.dims else product


def _join_channels(product: str, parts: list[xr.Dataset]) -> xr.Dataset:
    """Return one product from its channels' parts; what has no channel is the first part's."""
    joined = {}
    for name, values in parts[0].variables.items():
        if "channel" in values.dims:
            pieces = [_values(part.variables[name]) for part in parts]
            joined[str(name)] = np.concatenate(pieces, axis=values.dims.index("channel"))
        else:
            joined[str(name)] = _values(values)
    labels = {str(name): joined.pop(str(name)) for name in parts[0].coords}
    return variables.dataset(product, joined, labels)


def _values(variable: xr.Variable) -> NDArray[Any]:
    """Return a variable's values; of an index those that pandas keeps, which xarray would check."""
    if not isinstance(variable, xr.IndexVariable):
        return variable.values
    values = variable.to_index().to_numpy()
    return values if values.dtype == variable.dtype else values.astype(variable.dtype)


def _identity(product: xr.Dataset, origin: str) -> str:
    """Return what tells a product from others: its numbers if they are few, else its origin."""
    return origin if product.nbytes > _SMALL_BYTES else _fingerprint(product)


def _fingerprint(product: xr.Dataset) -> str:
    """Return a digest of a product's numbers and labels."""
    parts: list[str | bytes] = []
    for name, variable in sorted(product.variables.items(), key=lambda item: str(item[0])):
        values = _values(variable)
        labels = values.dtype.kind in "UO"
        parts += [
            str(name),
            f"{variable.dims} {values.dtype.str} {values.shape} {variable.attrs}",
            _text(values.tolist()) if labels else values.tobytes(),
        ]
    return _digest(*parts)


# One a process: threads share it, and so do a worker's tasks.
_MEMO = Memo()


def run_case(case: Case, memo: Memo | None = None, given: Given | None = None) -> Row:
    """Compute one case.

    Parameters
    ----------
    case
        The case.
    memo
        Where products are kept; by default, those of this process.
    given
        Products from files, each with what tells it from others.

    Returns
    -------
    dict
        The statistics by region, the median coherence on visible ground, the residues, and the
        focus by channel; if the scene has objects, how well they are found; in plain numbers.
    """
    memo = memo or _MEMO
    with blocks.serially():
        products = memo.products(_judged_by(case.study.scene), case.study, given)
    accuracy, interferogram, unwrapped, focus, truth = (products[name] for name in _RESULTS)
    row: Row = {name: accuracy[name].values.tolist() for name in (*_STATISTICS, *_JUDGED)}
    visible = ~truth["shadow"].values
    row["coherence"] = float(np.median(interferogram["coherence"].values[visible]))
    row["residues"] = int(np.abs(unwrapped["residue"].values).sum())
    ends = focus.sel(channel=list(CHANNELS))
    row |= {str(name): values.values.tolist() for name, values in ends.data_vars.items()}
    if _OF_OBJECTS in products:
        found = products[_OF_OBJECTS].data_vars
        row |= {str(name): values.values.tolist() for name, values in found.items()}
    return row


def _run_block(given: Given, block: list[Case]) -> Results:
    # Cases err on purpose, as their statistics tell; warnings of each would drown all others.
    _stages_logger.setLevel(logging.ERROR)
    rows, errors = {}, {}
    for case in block:
        try:
            rows[case.key] = run_case(case, given=given)
        except Exception as error:  # whatever a case raises must not cost the others
            errors[case.key] = f"{type(error).__name__}: {error}"
    return rows, errors


def _nothing(*_: object) -> None:
    pass


def run(
    study: Study,
    name: str,
    *,
    compute: Compute,
    finished: Mapping[str, Row] | None = None,
    keep: Callable[[dict[str, Row]], object] | None = None,
    progress: Callable[[int, int], object] | None = None,
    given: Mapping[str, xr.Dataset] | None = None,
) -> xr.Dataset:
    """Run a sweep.

    Parameters
    ----------
    study
        The study that the sweep belongs to.
    name
        Name of the sweep.
    compute
        ``compute(function, blocks, receive, lost)`` runs the function on each block of cases, in
        parallel, and calls, in this thread and in any order, ``receive`` with what it returns, or
        ``lost`` with a block that could not be run and a sentence that says why
        (`cluster.workers`).
    finished
        Rows of an earlier run, by the cases' keys; they are not computed again.
    keep
        Called with each block's rows as it finishes, in whatever order.
    progress
        Called with the number of finished cases and of all.
    given
        Products from the user's files, which all cases share.

    Returns
    -------
    xarray.Dataset
        Product ``sweep``: each swept key is a dimension, then ``realization``.

    Raises
    ------
    SweepError
        If cases raised, naming them; the others are finished and kept.
    validation.ConfigurationError
        If a case is not valid; nothing has run then.
    """
    known = {label: (data, _fingerprint(data)) for label, data in (given or {}).items()}
    everything = cases(study, name, *(digest for _, digest in known.values()))
    finished, keep, progress = finished or {}, keep or _nothing, progress or _nothing
    rows = {case.key: finished[case.key] for case in everything if case.key in finished}
    waiting = [case for case in everything if case.key not in rows]
    logger.info("%d of %d cases are finished", len(rows), len(everything))
    progress(len(rows), len(everything))
    errors: dict[str, str] = {}

    def receive(block: Results) -> None:
        done, failed = block
        keep(done)
        rows.update(done)
        errors.update(failed)
        progress(len(rows) + len(errors), len(everything))

    def lost(block: list[Case], reason: str) -> None:
        receive(({}, {case.key: reason for case in block}))

    if waiting:
        level = _stages_logger.level
        try:
            compute(partial(_run_block, known), _blocks(waiting), receive, lost)
        finally:
            _stages_logger.setLevel(level)
    if errors:
        listed = [f"{case}: {errors[case.key]}" for case in everything if case.key in errors]
        shown = "".join(f"\n  {line}" for line in listed[:10])
        more = f"\n  and {len(listed) - 10} more" if len(listed) > 10 else ""
        raise SweepError(
            f"{len(listed)} of {len(everything)} cases of the sweep '{name}' failed; the others "
            f"are kept, and the next run goes on from them:{shown}{more}"
        )
    return _assemble(study.sweeps[name], everything, rows)


def _blocks(waiting: list[Case]) -> list[list[Case]]:
    size = min(CASES_PER_BLOCK, max(1, len(waiting) // _LEAST_BLOCKS))
    return [waiting[begin : begin + size] for begin in range(0, len(waiting), size)]


def dimension(key: str) -> str:
    """Return the dimension that a swept key becomes."""
    return key.replace(".", "_")


def _assemble(sweep: Sweep, everything: list[Case], rows: Mapping[str, Row]) -> xr.Dataset:
    shape = [*(len(values) for values in sweep.over.values()), sweep.realizations]
    names = list(rows[everything[0].key])
    data: dict[str, Any] = {}
    for name in names:
        trailing = np.shape(rows[everything[0].key][name])
        values = np.empty((*shape, *trailing))
        for case in everything:
            values[case.index] = rows[case.key][name]
        data[name] = values.astype(int) if name == "residues" else values
    swept = {}
    for key, listed in sweep.over.items():
        unit = next((unit for end, unit in UNITS.items() if key.endswith(f"_{end}")), "1")
        numeric = all(_is_number(value) for value in listed)
        attrs = {"long_name": key} | ({"units": unit} if numeric else {})
        texts = [value if isinstance(value, str) else _text(value) for value in listed]
        labels = np.asarray(listed if numeric else texts)
        swept[dimension(key)] = (labels, attrs)
    coords = {}
    if "height_found" in data:
        coords = {
            "height_threshold": detection_accuracy.HEIGHT_THRESHOLDS,
            "amplitude_threshold": detection_accuracy.AMPLITUDE_THRESHOLDS,
            "object": np.arange(data["object_height"].shape[-1]),
        }
    return sweep_dataset(data, swept, coords)


def sweep_dataset(
    data: Mapping[str, Any],
    swept: Mapping[str, tuple[Any, dict[str, str]]],
    coords: Mapping[str, Any] | None = None,
) -> xr.Dataset:
    """Make a sweep's product.

    Parameters
    ----------
    data
        An array for each variable of `SWEEP`, or of `SWEEP_OF_OBJECTS`: swept keys, realization,
        then its own dimensions.
    swept
        Values and attributes of each swept key's dimension, in order.
    coords
        The coordinates' values of dimensions that are neither region nor channel.

    Returns
    -------
    xarray.Dataset
        Product ``sweep``.
    """
    result = xr.Dataset()
    leading = (*swept, "realization")
    for name, values in data.items():
        variable = SWEEP_OF_OBJECTS[name]
        result[name] = ((*leading, *variable.dims), values, variable.attrs)
    for name, (labels, attrs) in swept.items():
        result = result.assign_coords({name: (name, labels, attrs)})
    own = {
        "realization": np.arange(result.sizes["realization"]),
        "region": np.array(REGIONS),
        "channel": np.array(CHANNELS),
        "ground_axis": np.array(variables.LABELS["ground_axis"]),
    }
    for name, labels in (own | dict(coords or {})).items():
        result = result.assign_coords({name: (name, labels, variables.COORDINATES[name].attrs)})
    return result


def _check_sweep(data: xr.Dataset) -> None:
    found = {str(name) for name in data.data_vars}
    declared = SWEEP_OF_OBJECTS if found - set(SWEEP) else SWEEP
    if found != set(declared):
        raise ValueError(
            f"product 'sweep' holds {sorted(found)}, but {sorted(declared)} are declared"
        )
    for name, variable in declared.items():
        dims = data[name].dims
        own = len(variable.dims)
        if dims[len(dims) - own :] != variable.dims or "realization" not in dims:
            raise ValueError(
                f"'{name}' of product 'sweep' has the dimensions {dims}, but the swept keys, "
                f"realization and {variable.dims} are declared"
            )
        for attribute, value in variable.attrs.items():
            if data[name].attrs.get(attribute) != value:
                raise ValueError(
                    f"'{name}' of product 'sweep' has {attribute}="
                    f"{data[name].attrs.get(attribute)!r}, but {value!r} is declared"
                )


variables.declare("sweep", {}, check=_check_sweep)
