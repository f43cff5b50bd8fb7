"""Looking up samples whose places lie close together, in vector registers where there are some.

AVX-512 finds 16 samples among 32 in two registers with one instruction. Without it, or where places
lie further apart, samples are copied one by one: the same samples, so the same results.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import config, types
from numba.core import cgutils
from numba.extending import intrinsic

from vinsar.kernels.compiling import part

LANES = 16
"""Samples that are looked up at once."""

PADDING = 64
"""Samples that tables must hold beyond the last one used, so that a window never ends early."""

_FLOAT, _INT = ir.FloatType(), ir.IntType(32)
FLOATS, INTS = ir.VectorType(_FLOAT, LANES), ir.VectorType(_INT, LANES)

FLAGS = ("contract", "nsz")
"""What the arithmetic of intrinsics may do, as in `compiling`."""


@intrinsic
def has_permute(typingctx):  # type: ignore[no-untyped-def]
    """Tell whether the machine that is compiled for looks samples up in vector registers."""
    del typingctx

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        del builder, signature, arguments
        return ir.Constant(ir.IntType(1), permutes(context))

    return types.boolean(), generate


@part
def pairs_for(reach: Any) -> int:
    """Return how many pairs of registers make a window that holds a group's samples, or 0.

    Parameters
    ----------
    reach
        Upper bound of the distance of any sample from the group's middle one, in samples.
    """
    if not has_permute():
        return 0
    # A window of 32 or 64 begins 15 or 31 samples before the middle; four samples may be read.
    if reach < 14:
        return 1
    return 2 if reach < 30 else 0


class Emitter:
    """Writes the vector instructions of an intrinsic.

    Parameters
    ----------
    context, builder, signature, arguments
        What Numba hands to the code generator of an intrinsic.
    """

    def __init__(self, context: Any, builder: Any, signature: Any, arguments: Any) -> None:
        self.context, self.builder = context, builder
        self.types, self.arguments = signature.args, arguments

    def array(self, number: int, item: int | None = None) -> Any:
        """Return an array argument, or an item of a tuple of them."""
        kind, value = self.types[number], self.arguments[number]
        if item is not None:
            kind, value = kind.dtype, cgutils.unpack_tuple(self.builder, value)[item]
        return self.context.make_array(kind)(self.context, self.builder, value)

    def pointer(self, array: Any, position: Any, kind: Any) -> Any:
        """Return a pointer to a vector that begins at a position of an array."""
        place = self.builder.gep(array.data, [position])
        return self.builder.bitcast(place, kind.as_pointer())

    def load(self, array: Any, position: Any, kind: Any = FLOATS) -> Any:
        """Return the vector at a position."""
        value = self.builder.load(self.pointer(array, position, kind))
        value.align = 4
        return value

    def store(self, value: Any, array: Any, position: Any) -> None:
        """Write a vector to a position."""
        self.builder.store(value, self.pointer(array, position, value.type)).align = 4

    def splat(self, value: Any) -> Any:
        """Return a vector of one whole number."""
        nothing = ir.Constant(INTS, ir.Undefined)
        first = self.builder.insert_element(nothing, value, ir.Constant(_INT, 0))
        return self.builder.shuffle_vector(first, nothing, ir.Constant(INTS, [0] * LANES))

    def window(self, indices: Any, base: Any, table: Any, pairs: int) -> tuple[Any, Any]:
        """Return where the window begins that the middle index sets, and places within it."""
        builder = self.builder
        origin = builder.trunc(base, _INT)
        middle = builder.extract_element(indices, ir.Constant(_INT, LANES // 2))
        start = builder.sub(builder.add(middle, origin), ir.Constant(_INT, pairs * LANES - 1))
        samples = builder.trunc(cgutils.unpack_tuple(builder, table.shape)[0], _INT)
        most = builder.sub(samples, ir.Constant(_INT, 2 * LANES * pairs))
        # Whatever the indices are, no sample is read outside the table.
        below = builder.icmp_signed("<", start, ir.Constant(_INT, 0))
        start = builder.select(below, ir.Constant(_INT, 0), start)
        above = builder.icmp_signed(">", start, most)
        start = builder.select(above, most, start)
        places = builder.add(indices, self.splat(builder.sub(origin, start)))
        return builder.sext(start, ir.IntType(64)), places

    def look_up(self, table: Any, start: Any, places: Any, taps: int, pairs: int) -> list[Any]:
        """Return the samples at places in the window, and at the next ones for further taps."""
        builder = self.builder
        registers = [
            self.load(table, builder.add(start, ir.Constant(start.type, LANES * number)))
            for number in range(2 * pairs)
        ]
        permute = cgutils.get_or_insert_function(
            builder.module,
            ir.FunctionType(FLOATS, [FLOATS, INTS, FLOATS]),
            "llvm.x86.avx512.vpermi2var.ps.512",
        )
        result = []
        for tap in range(taps):
            at = builder.add(places, ir.Constant(INTS, [tap] * LANES))
            # The instruction looks at the five lowest bits of a place.
            found = builder.call(permute, [registers[0], at, registers[1]])
            if pairs == 2:
                other = builder.call(permute, [registers[2], at, registers[3]])
                beyond = builder.icmp_signed(">=", at, ir.Constant(INTS, [2 * LANES] * LANES))
                found = builder.select(beyond, other, found)
            result.append(found)
        return result

    def fused(self, a: Any, b: Any, c: Any) -> Any:
        """Return a b + c, which may be rounded once."""
        product = self.builder.fmul(a, b, flags=FLAGS)
        return self.builder.fadd(product, c, flags=FLAGS)


def contiguous(*arrays: Any) -> bool:
    """Tell whether array types know no strides, as the pointers of `Emitter` do not."""
    kinds = [array.dtype if isinstance(array, types.BaseTuple) else array for array in arrays]
    return all(kind.layout == "C" for kind in kinds)


def permutes(context: Any) -> bool:
    """Tell whether the machine that is compiled for has the instruction."""
    return "+avx512f" in context.codegen().magic_tuple()[2]


def _window_copier(pairs: int) -> Any:
    @intrinsic
    def copy_window(typingctx, index, begin, base, table, out):  # type: ignore[no-untyped-def]
        """Copy ``table[base + index[begin:begin + LANES] + tap]`` to ``out[tap][begin:...]``."""
        del typingctx
        if not contiguous(index, table, out):
            return None

        def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
            # Without the instruction it is never reached: there are no pairs then.
            if permutes(context):
                emit = Emitter(context, builder, signature, arguments)
                begin, samples = arguments[1], emit.array(3)
                start, places = emit.window(
                    emit.load(emit.array(0), begin, INTS), arguments[2], samples, pairs
                )
                taps = emit.look_up(samples, start, places, out.count, pairs)
                for tap, found in enumerate(taps):
                    emit.store(found, emit.array(4, tap), begin)
            return context.get_dummy_value()

        return types.void(index, begin, base, table, out), generate

    return copy_window


_copy_from_pair, _copy_from_pairs = _window_copier(1), _window_copier(2)


if config.DISABLE_JIT:  # Then the kernels are plain Python, which has no vector registers.

    def has_permute() -> bool:
        """Tell that there are none."""
        return False


@part
def copy(pairs, index, base, table, out):  # type: ignore[no-untyped-def]
    """Copy ``table[base + index[i] + tap]`` to ``out[tap][i]`` for all i and taps.

    Parameters
    ----------
    pairs
        From `pairs_for`, for all groups of `LANES`.
    index
        Places (count,), int32; unless pairs is 0, a multiple of `LANES`.
    base
        What to add to them, int64.
    table
        Samples, float32, with `PADDING` to spare. A place outside gives some other sample.
    out
        An array for each tap, 4 at most (count,), float32.
    """
    if pairs == 1:
        for begin in range(0, index.size, LANES):
            _copy_from_pair(index, np.int64(begin), base, table, out)
    elif pairs == 2:
        for begin in range(0, index.size, LANES):
            _copy_from_pairs(index, np.int64(begin), base, table, out)
    else:
        last = table.size - PADDING
        for i in range(index.size):
            # Unsigned, so that no negative index needs a look.
            k = np.uint64(min(max(base + index[i], 0), last))
            for tap in range(len(out)):
                out[tap][i] = table[k + np.uint64(tap)]
