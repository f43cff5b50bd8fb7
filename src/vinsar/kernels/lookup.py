"""Looking up samples whose places lie close together, in vector registers where there are some.

A window of the table is loaded into registers and a permutation finds the samples of a whole group
of neighbours in it: AVX-512 finds 16 among 32 with one instruction, AVX2 8 among 8. Where places
lie further apart, or there is no permutation, samples are loaded one by one: the same samples, so
the same results.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import config, types
from numba.core import cgutils
from numba.extending import intrinsic

from vinsar.kernels.compiling import part

LANES = 16
"""Places come in whole groups of so many, which is a multiple of every machine's `lanes`."""

PADDING = 64
"""Samples that tables must hold beyond the last one used, so that a window never ends early."""

FLAGS = ("contract", "nsz")
"""What the arithmetic of intrinsics may do, as in `compiling`."""

_FLOAT, _INT = ir.FloatType(), ir.IntType(32)
_PERMUTATIONS = {16: "llvm.x86.avx512.vpermi2var.ps.512", 8: "llvm.x86.avx2.permps"}


def permuted_lanes(context: Any) -> int:
    """Return how many samples the machine that is compiled for looks up at once; 0 if it cannot."""
    features = context.codegen().magic_tuple()[2].split(",")
    return 16 if "+avx512f" in features else 8 if "+avx2" in features else 0


def _compiled_constant(value: Any) -> Any:
    """Make a function of compiled code that returns an integer which the machine decides."""

    @intrinsic
    def constant(typingctx):  # type: ignore[no-untyped-def]
        del typingctx

        def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
            del builder, signature, arguments
            return ir.Constant(ir.IntType(64), value(context))

        return types.int64(), generate

    return constant


lanes = _compiled_constant(lambda context: permuted_lanes(context) or 8)
_window = _compiled_constant(lambda context: {16: 32, 8: 8, 0: 0}[permuted_lanes(context)])

if config.DISABLE_JIT:  # Then the kernels are plain Python, which has no vector registers.

    def lanes() -> int:
        """Tell how many places make a group that is looked up at once."""
        return 8

    def _window() -> int:
        return 0


@part
def windows_for(reach: Any, taps: int) -> int:
    """Return how many windows of registers hold all samples of a group, or 0.

    Parameters
    ----------
    reach
        Upper bound of the distance of any place from that of its group's middle, in samples. A
        group are `lanes` places, its middle is number ``lanes // 2``.
    taps
        Samples that are looked up from each place on, 2 or 4.
    """
    size = _window()
    if 2 * reach <= size - taps:
        return 1
    # Two windows of 8 would cost more than samples one by one.
    return 2 if size == 2 * LANES and 2 * reach <= 2 * size - taps else 0


class Emitter:
    """Writes the vector instructions of an intrinsic.

    Parameters
    ----------
    context, builder, signature, arguments
        What Numba hands to the code generator of an intrinsic.
    lanes
        Length of the vectors; 0 for as many as the machine looks up at once.
    """

    def __init__(
        self, context: Any, builder: Any, signature: Any, arguments: Any, lanes: int = 0
    ) -> None:
        self.context, self.builder = context, builder
        self.types, self.arguments = signature.args, arguments
        self.permuted = permuted_lanes(context)
        self.lanes = lanes or self.permuted or 8
        self.floats = ir.VectorType(_FLOAT, self.lanes)
        self.ints = ir.VectorType(_INT, self.lanes)

    def has(self, windows: int) -> bool:
        """Tell whether the machine looks up in so many windows; if not, `windows_for` avoids it."""
        return windows <= {LANES: 2, 8: 1, 0: 0}[self.permuted]

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

    def load(self, array: Any, position: Any, kind: Any = None) -> Any:
        """Return the vector at a position."""
        value = self.builder.load(self.pointer(array, position, kind or self.floats))
        value.align = 4
        return value

    def store(self, value: Any, array: Any, position: Any) -> None:
        """Write a vector to a position."""
        self.builder.store(value, self.pointer(array, position, value.type)).align = 4

    def repeated(self, values: Any) -> Any:
        """Return a vector of a few numbers in turns."""
        whole = ir.Constant(ir.VectorType(values[0].type, self.lanes), ir.Undefined)
        vector = whole
        for number, value in enumerate(values):
            vector = self.builder.insert_element(vector, value, ir.Constant(_INT, number))
        order = [lane % len(values) for lane in range(self.lanes)]
        return self.shuffled(vector, whole, order)

    def shuffled(self, a: Any, b: Any, order: Any) -> Any:
        """Return the elements of two vectors, one after the other, in another order."""
        order = list(order)
        return self.builder.shuffle_vector(
            a, b, ir.Constant(ir.VectorType(_INT, len(order)), order)
        )

    def window(self, indices: Any, base: Any, table: Any, taps: int, windows: int) -> Any:
        """Return where the window begins that the middle index sets, and places within it."""
        builder = self.builder
        size = windows * (2 * LANES if self.permuted == LANES else 8)
        origin = builder.trunc(base, _INT)
        middle = builder.extract_element(indices, ir.Constant(_INT, self.lanes // 2))
        before = ir.Constant(_INT, (size - taps) // 2)
        start = builder.sub(builder.add(middle, origin), before)
        samples = builder.trunc(cgutils.unpack_tuple(builder, table.shape)[0], _INT)
        most = builder.sub(samples, ir.Constant(_INT, size))
        # Whatever the indices are, no sample is read outside the table.
        below = builder.icmp_signed("<", start, ir.Constant(_INT, 0))
        start = builder.select(below, ir.Constant(_INT, 0), start)
        above = builder.icmp_signed(">", start, most)
        start = builder.select(above, most, start)
        places = builder.add(indices, self.repeated([builder.sub(origin, start)]))
        return builder.sext(start, ir.IntType(64)), places

    def look_up(self, table: Any, start: Any, places: Any, taps: int, windows: int) -> list[Any]:
        """Return the samples at places in the window, and at the next ones for further taps."""
        builder = self.builder
        count = windows * (2 if self.permuted == LANES else 1)
        registers = [
            self.load(table, builder.add(start, ir.Constant(start.type, self.lanes * number)))
            for number in range(count)
        ]
        found = []
        for tap in range(taps):
            at = builder.add(places, ir.Constant(self.ints, [tap] * self.lanes))
            # The instructions look at the lowest bits of a place only.
            samples = self._permuted(registers[:2], at)
            if windows == 2:
                other = self._permuted(registers[2:], at)
                beyond = builder.icmp_signed(
                    ">=", at, ir.Constant(self.ints, [2 * self.lanes] * self.lanes)
                )
                samples = builder.select(beyond, other, samples)
            found.append(samples)
        return found

    def _permuted(self, registers: Any, at: Any) -> Any:
        kinds = [self.floats, self.ints, self.floats][: 1 + len(registers)]
        name = _PERMUTATIONS[self.lanes]
        function = cgutils.get_or_insert_function(
            self.builder.module, ir.FunctionType(self.floats, kinds), name
        )
        return self.builder.call(function, [registers[0], at, *registers[1:]])

    def gather(self, table: Any, index: Any, begin: Any, base: Any, taps: int) -> list[Any]:
        """Return the samples at 8 places, and at the next ones for further taps, one by one."""
        builder, four = self.builder, ir.VectorType(_FLOAT, 4)
        rows = []
        for number in range(8):
            at = builder.gep(index.data, [builder.add(begin, ir.Constant(begin.type, number))])
            place = builder.add(base, builder.sext(builder.load(at), base.type))
            rows.append(self.load(table, place, four))
        # The places' rows of four samples become vectors of 8 places: a transposition.
        pairs = [self.shuffled(rows[n], rows[n + 4], range(8)) for n in range(4)]
        low, high = (0, 8, 1, 9, 4, 12, 5, 13), (2, 10, 3, 11, 6, 14, 7, 15)
        first, second = (0, 1, 8, 9, 4, 5, 12, 13), (2, 3, 10, 11, 6, 7, 14, 15)
        found = []
        for half in (low, high)[: taps // 2]:
            a, b = (self.shuffled(pairs[n], pairs[n + 1], half) for n in (0, 2))
            found += [self.shuffled(a, b, first), self.shuffled(a, b, second)]
        return found

    def times(self, a: Any, b: Any) -> Any:
        """Return a b."""
        return self.builder.fmul(a, b, flags=FLAGS)

    def minus(self, a: Any, b: Any) -> Any:
        """Return a - b."""
        return self.builder.fsub(a, b, flags=FLAGS)

    def fused(self, a: Any, b: Any, c: Any) -> Any:
        """Return a b + c, which may be rounded once."""
        return self.builder.fadd(self.times(a, b), c, flags=FLAGS)


def contiguous(*arrays: Any) -> bool:
    """Tell whether array types know no strides, as the pointers of `Emitter` do not."""
    kinds = [array.dtype if isinstance(array, types.BaseTuple) else array for array in arrays]
    return all(kind.layout == "C" for kind in kinds)
