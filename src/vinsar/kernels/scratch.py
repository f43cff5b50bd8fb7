"""Scratch buffers on the stack: arrays of which the compiler knows that they do not overlap.

Loops over such arrays need no checks, which short ones spend much of their time on.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import carray, config, types
from numba.core import cgutils
from numba.extending import intrinsic

from vinsar.kernels.compiling import part

SIZE = 256
"""Items of a buffer."""


def _allocator(kind: Any) -> Any:
    @intrinsic
    def allocate(typingctx):  # type: ignore[no-untyped-def]
        """Return a pointer to a buffer of the calling function."""
        del typingctx

        def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
            del signature, arguments
            item = context.get_value_type(kind)
            buffer = cgutils.alloca_once(builder, ir.ArrayType(item, SIZE))
            buffer.align = 64
            return builder.bitcast(buffer, item.as_pointer())

        return types.CPointer(kind)(), generate

    return allocate


_floats, _doubles = _allocator(types.float32), _allocator(types.float64)
_integers = _allocator(types.int32)


@part
def floats():  # type: ignore[no-untyped-def]
    """Return a buffer of `SIZE` float32; a caller of compiled code owns it until it returns."""
    return carray(_floats(), SIZE)


@part
def doubles():  # type: ignore[no-untyped-def]
    """Return a buffer of `SIZE` float64, like `floats`."""
    return carray(_doubles(), SIZE)


@part
def integers():  # type: ignore[no-untyped-def]
    """Return a buffer of `SIZE` int32, like `floats`."""
    return carray(_integers(), SIZE)


if config.DISABLE_JIT:  # Then the kernels are plain Python.

    def floats() -> Any:
        """Return a buffer of `SIZE` float32."""
        return np.empty(SIZE, np.float32)

    def doubles() -> Any:
        """Return a buffer of `SIZE` float64."""
        return np.empty(SIZE, np.float64)

    def integers() -> Any:
        """Return a buffer of `SIZE` int32."""
        return np.empty(SIZE, np.int32)
