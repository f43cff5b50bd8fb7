"""Sweeps: every combination of keys of the configuration, each repeated, on Dask.

A case is a study. What its stages have in common with another case is computed once: a stage's
product is kept under its name, the keys of the configuration that it declares, and the contents of
its inputs, by channel where the stage works by channel. Nothing here knows what is swept.
"""

from __future__ import annotations

import hashlib
import json
import logging
import threading
from collections import OrderedDict
from concurrent.futures import Future
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from vinsar import blocks, config, pipeline, validation, variables
from vinsar.constants import CHANNELS

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping

    Row = dict[str, Any]

logger = logging.getLogger(__name__)

CASES_PER_BLOCK = 15
"""Cases that a worker takes at a time, and at most lose when it dies."""

_RESULTS = ("accuracy", "interferogram", "unwrapped", "focus", "truth")
_STATISTICS = (
    "mean",
    "std",
    "median",
    "mad",
    "percentile_95_absolute",
    "maximum_absolute",
    "fraction_within_tolerance",
    "fraction_reconstructed",
)
_UNITS = {"m": "m", "hz": "Hz", "db": "dB", "deg": "degree"}


class SweepError(RuntimeError):
    """Cases that raised; those that finished are kept."""


@dataclass(frozen=True)
class Case:
    """One study of a sweep.

    Attributes
    ----------
    index
        Place along each swept key, and the realization last.
    changes
        Swept key and its value.
    study
        The study.
    key
        Digest of all that the case depends on in the configuration.
    """

    index: tuple[int, ...]
    changes: dict[str, Any]
    study: config.Study
    key: str

    def __str__(self) -> str:
        values = ", ".join(f"{key} = {value}" for key, value in self.changes.items())
        return f"{values}, realization {self.study.realization}"


def _digest(*parts: str | bytes) -> str:
    digest = hashlib.blake2b(digest_size=16)
    for part in parts:
        digest.update(part.encode() if isinstance(part, str) else part)
        digest.update(b"\0")
    return digest.hexdigest()


def _text(value: Any) -> str:
    return json.dumps(value, sort_keys=True)


def declared() -> list[str]:
    """Return every key of the configuration that the stages of a case declare."""
    return list(
        dict.fromkeys(name for s in pipeline.needed(_RESULTS).values() for name in s.sections)
    )


def cases(study: config.Study, name: str) -> list[Case]:
    """Return a sweep's cases, those that share their first stages next to each other.

    Parameters
    ----------
    study
        The study that the sweep belongs to.
    name
        Name of the sweep.

    Returns
    -------
    list of Case
        The product of the swept values and the realizations.

    Raises
    ------
    validation.ConfigurationError
        If any case is not a valid study; nothing has run then.
    """
    sweep = study.sweeps[name]
    studies = validation.sweep_studies(study, name)
    shape = [len(values) for values in sweep.over.values()]
    sections = [stage.sections for stage in pipeline.needed(_RESULTS).values()]
    found = []
    for index, (changes, case) in zip(np.ndindex(*shape), studies, strict=True):
        for realization in range(sweep.realizations):
            one = case.model_copy(update={"realization": realization})
            key = _digest(_text(one.values(declared())))
            found.append(Case((*index, realization), changes, one, key))
    # What the first stages read changes slowest, so that few of their products are kept at a time.
    order: list[dict[str, int]] = [{} for _ in sections]

    def rank(case: Case) -> tuple[int, ...]:
        texts = [_text(case.study.values(names)) for names in sections]
        return tuple(
            seen.setdefault(text, len(seen)) for seen, text in zip(order, texts, strict=True)
        )

    return sorted(found, key=rank)


class _Product:
    """A stage's product with the digest of its numbers, whole and by channel."""

    def __init__(self, parts: list[xr.Dataset]) -> None:
        self._parts = [(part, _contents(part)) for part in parts]
        self._whole: tuple[xr.Dataset, str] | None = None
        self._channels: list[tuple[xr.Dataset, str]] | None = None

    @classmethod
    def of_channels(cls, products: list[_Product]) -> _Product:
        made = cls([])
        made._parts = [product._parts[0] for product in products]
        return made

    def whole(self) -> tuple[xr.Dataset, str]:
        if self._whole is None:
            self._whole = self._parts[0]
            if len(self._parts) > 1:
                joined = pipeline.join_channels([part for part, _ in self._parts])
                self._whole = joined, _digest(*(digest for _, digest in self._parts))
        return self._whole

    def channel(self, index: int) -> tuple[xr.Dataset, str]:
        if len(self._parts) > 1:
            return self._parts[index]
        whole = self._parts[0][0]
        if "channel" not in whole.dims:
            return self._parts[0]
        if self._channels is None:
            split = [pipeline.split_channel({"": whole}, name)[""] for name in CHANNELS]
            self._channels = [(part, _contents(part)) for part in split]
        return self._channels[index]


class Memo:
    """Products of stages, the latest of each stage, shared by the threads of a process.

    Parameters
    ----------
    capacity
        How many products of a stage (and channel) are kept.

    Attributes
    ----------
    computed
        How often each stage (and channel) has been computed.
    """

    def __init__(self, capacity: int) -> None:
        self._capacity = capacity
        self._lock = threading.Lock()
        self._kept: dict[str, OrderedDict[str, Future[_Product]]] = {}
        self.computed: dict[str, int] = {}

    def products(self, names: Iterable[str], study: config.Study) -> pipeline.Products:
        """Return products for a study, computing only what is not kept."""
        made: dict[str, _Product] = {}
        wanted = tuple(names)
        for name, stage in pipeline.needed(wanted).items():
            setting = study.values(stage.sections)
            compute = partial(_compute, stage, setting)
            inputs = {key: made[key] for key in stage.inputs}
            if stage.by_channel:
                made[name] = _Product.of_channels(
                    [
                        self._get(
                            f"{name}/{label}",
                            _text(setting),
                            {key: product.channel(index) for key, product in inputs.items()},
                            compute,
                        )
                        for index, label in enumerate(CHANNELS)
                    ]
                )
            else:
                whole = {key: product.whole() for key, product in inputs.items()}
                made[name] = self._get(name, _text(setting), whole, compute)
        return {name: made[name].whole()[0] for name in wanted}

    def _get(
        self,
        name: str,
        setting: str,
        inputs: Mapping[str, tuple[xr.Dataset, str]],
        compute: Callable[[pipeline.Products], xr.Dataset],
    ) -> _Product:
        key = _digest(setting, *(digest for _, digest in inputs.values()))
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
                future.set_result(_Product([product]))
            except BaseException as error:
                with self._lock:
                    kept.pop(key, None)
                future.set_exception(error)
        return future.result()


def _compute(
    stage: pipeline.Stage, setting: dict[str, Any], products: pipeline.Products
) -> xr.Dataset:
    return stage.compute(products, config.Study.part(setting))


def _contents(product: xr.Dataset) -> str:
    """Return the digest of a product's numbers."""
    parts: list[str | bytes] = []
    for name in sorted(map(str, product.variables)):
        values = product.variables[name].values
        text = values.dtype.kind in "UO"
        parts += [name, str(values.shape), _text(values.tolist()) if text else values.tobytes()]
    return _digest(*parts)


# One a process: threads share it, and so do a worker's tasks. Two generations a thread suffice.
_MEMO = Memo(capacity=8)


def run_case(case: Case, memo: Memo | None = None) -> Row:
    """Compute one case.

    Parameters
    ----------
    case
        The case.
    memo
        Where products are kept; by default, those of this process.

    Returns
    -------
    dict
        The statistics by region, the median coherence on visible ground, the residues, and the
        point gain by channel, in plain numbers.
    """
    memo = memo or _MEMO
    with blocks.serially():
        products = memo.products(_RESULTS, case.study)
    accuracy, interferogram, unwrapped, focus, truth = (products[name] for name in _RESULTS)
    row: Row = {name: accuracy[name].values.tolist() for name in _STATISTICS}
    visible = ~truth["shadow"].values
    row["coherence"] = float(np.median(interferogram["coherence"].values[visible]))
    row["residues"] = int(np.abs(unwrapped["residue"].values).sum())
    row["point_gain"] = focus["point_gain"].values.tolist()
    return row


def _run_block(block: list[Case]) -> tuple[dict[str, Row], dict[str, str]]:
    rows, errors = {}, {}
    for case in block:
        try:
            rows[case.key] = run_case(case)
        except Exception as error:  # whatever a case raises must not cost the others
            errors[case.key] = f"{type(error).__name__}: {error}"
    return rows, errors


def run(
    study: config.Study,
    name: str,
    *,
    finished: Mapping[str, Row],
    keep: Callable[[dict[str, Row]], None],
    progress: Callable[[int, int], None],
    compute: Callable[[Callable[[list[Case]], Any], list[list[Case]], Callable[[Any], None]], None],
) -> xr.Dataset:
    """Run a sweep.

    Parameters
    ----------
    study
        The study that the sweep belongs to.
    name
        Name of the sweep.
    finished
        Rows of an earlier run, by the cases' keys; they are not computed again.
    keep
        Called with each block's rows as it finishes, in whatever order.
    progress
        Called with the number of finished cases and of all.
    compute
        Runs a function on blocks of cases, in parallel, and calls another with what it returns,
        in this thread and in any order (`cluster.workers`).

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
    everything = cases(study, name)
    rows = {case.key: finished[case.key] for case in everything if case.key in finished}
    waiting = [case for case in everything if case.key not in rows]
    logger.info("%d of %d cases are finished", len(rows), len(everything))
    progress(len(rows), len(everything))
    errors: dict[str, str] = {}

    def receive(block: tuple[dict[str, Row], dict[str, str]]) -> None:
        done, failed = block
        keep(done)
        rows.update(done)
        errors.update(failed)
        progress(len(rows) + len(errors), len(everything))

    compute(_run_block, list(_blocks(waiting)), receive)
    if errors:
        listed = [f"{case}: {errors[case.key]}" for case in everything if case.key in errors]
        shown = "".join(f"\n  {line}" for line in listed[:10])
        more = f"\n  and {len(listed) - 10} more" if len(listed) > 10 else ""
        raise SweepError(
            f"{len(listed)} of {len(everything)} cases of the sweep '{name}' failed; the others "
            f"are kept, and the next run goes on from them:{shown}{more}"
        )
    return _assemble(study.sweeps[name], everything, rows)


def _blocks(waiting: list[Case]) -> Iterator[list[Case]]:
    for begin in range(0, len(waiting), CASES_PER_BLOCK):
        yield waiting[begin : begin + CASES_PER_BLOCK]


def dimension(key: str) -> str:
    """Return the dimension that a swept key becomes."""
    return key.replace(".", "_")


def _assemble(sweep: config.Sweep, everything: list[Case], rows: Mapping[str, Row]) -> xr.Dataset:
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
        unit = _UNITS.get(key.rpartition("_")[2], "1")
        numeric = all(isinstance(v, int | float) and not isinstance(v, bool) for v in listed)
        attrs = {"long_name": key} | ({"units": unit} if numeric else {})
        labels = np.asarray(listed) if numeric else np.asarray([str(v) for v in listed])
        swept[dimension(key)] = (labels, attrs)
    return variables.sweep_dataset(data, swept)
