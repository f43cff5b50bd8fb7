"""What a stage of the chain is: what it reads, which keys it depends on, what it computes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

    import xarray as xr

    from vinsar.foundations.configuration import Study

Products = dict[str, "xr.Dataset"]
"""Products by name."""


@dataclass(frozen=True)
class Stage:
    """A step of the chain, declared in the module whose function it is.

    Attributes
    ----------
    compute
        From the input products and the study to the stage's product.
    inputs
        Products that it reads.
    sections
        Parts of the configuration that it reads, and no others: sections, or single keys such as
        ``radar.frequency_count``.
    by_channel
        Whether each channel comes from its own part of the inputs alone, so that a sweep computes
        it only where that changes.
    optional
        Products that it reads if the study has them.
    parallel
        Whether it keeps more than one core busy.
    when
        Whether a study has it; without, every study does.
    """

    compute: Callable[[Products, Study], xr.Dataset]
    inputs: tuple[str, ...] = ()
    sections: tuple[str, ...] = ()
    by_channel: bool = False
    optional: tuple[str, ...] = ()
    parallel: bool = False
    when: Callable[[Study], bool] | None = None

    @property
    def module(self) -> str:
        """The module that declares it, whose code and imports its product depends on."""
        return self.compute.__module__
