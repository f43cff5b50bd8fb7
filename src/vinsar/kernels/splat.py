"""Echoes of facets spread over range bins by B-splines: the adjoint of back-projection.

Each facet, turned by its phase at the middle frequency, adds to the four or six range bins around
it. A Fourier transform of the bins, divided by the splines' sinc^4 or sinc^6, then is the echo:
what interpolating back-projection does, transposed, with the same error.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from llvmlite import ir
from numba import config, types
from numba.extending import intrinsic

from vinsar.kernels import scratch
from vinsar.kernels.compiling import kernel
from vinsar.kernels.functions import fine_phasor, phasor
from vinsar.kernels.lookup import Emitter
from vinsar.kernels.paths import distances

MOST_TAPS = 6
"""Range bins that a facet reaches at most: bins beyond the last one needed."""

COPIES = 8
"""Copies of the bins that save most time: more leave the fastest cache."""


def _weights(taps: int) -> np.ndarray:
    """Return the B-splines that reach a place between two bins, as polynomials of its fraction.

    Parameters
    ----------
    taps
        Number of splines, one more than their degree.

    Returns
    -------
    ndarray, shape (power, tap)
        Coefficients, of rising powers of the fraction.
    """
    # The spline around bin j is a sum of truncated powers; at the fraction f it is at f + taps/2
    # - 1 - j from its middle (I. J. Schoenberg).
    result = np.zeros((taps, taps))
    for tap in range(taps):
        for knot in range(taps - tap):
            sign = (-1) ** knot * math.comb(taps, knot) / math.factorial(taps - 1)
            for power in range(taps):
                shift = (taps - 1 - tap - knot) ** (taps - 1 - power)
                result[power, tap] += sign * math.comb(taps - 1, power) * shift
    return result


def _adder(taps: int) -> Any:
    """Make the function that adds one facet to the bins."""
    # Each weight counts twice, for the real and the imaginary part.
    weights = np.repeat(_weights(taps), 2, axis=1).astype(np.float32)
    # Vectors of 8 and of 4: together as long as the bins that a facet reaches.
    pieces = [(0, 8)] if taps == 4 else [(0, 8), (8, 4)]

    if config.DISABLE_JIT:  # Then the kernels are plain Python.

        def add(parts, bin_, fraction, real, imag):  # type: ignore[no-untyped-def]
            weight = fraction ** np.arange(taps, dtype=np.float32) @ weights
            weight[::2] *= real
            weight[1::2] *= imag
            parts[2 * bin_ : 2 * (bin_ + taps)] += weight

        return add

    @intrinsic
    def add_facet(typingctx, parts, bin_, fraction, real, imag):  # type: ignore[no-untyped-def]
        """Add a facet to ``parts[2 * bin_:]``, real and imaginary parts in turns."""
        del typingctx

        def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
            array = Emitter(context, builder, signature, arguments).array(0)
            begin = builder.shl(arguments[1], ir.Constant(arguments[1].type, 1))
            for first, size in pieces:
                emit = Emitter(context, builder, signature, arguments, size)

                def constant(
                    row: Any, emit: Any = emit, at: Any = slice(first, first + size)
                ) -> Any:
                    return ir.Constant(emit.floats, [float(value) for value in row[at]])

                place = emit.repeated([arguments[2]])
                weight = constant(weights[-1])
                for row in weights[-2::-1]:
                    weight = emit.fused(weight, place, constant(row))
                at = builder.add(begin, ir.Constant(begin.type, first))
                value = emit.repeated(arguments[3:])
                emit.store(emit.fused(weight, value, emit.load(array, at)), array, at)
            return context.get_dummy_value()

        return types.void(parts, bin_, fraction, real, imag), generate

    return add_facet


_add_to_four, _add_to_six = _adder(4), _adder(6)


@kernel
def spread(
    facets: np.ndarray,
    amplitude: np.ndarray,
    visible: np.ndarray,
    transmitter: np.ndarray,
    receiver: np.ndarray,
    spreading_reference: float,
    turns_per_metre: float,
    steps_per_metre: float,
    taps: int,
    copies: np.ndarray,
    bins: np.ndarray,
) -> None:
    """Add the visible facets of one antenna position to the range bins.

    Parameters
    ----------
    facets
        Positions (3, facet), float64.
    amplitude
        Amplitudes (facet,), float32.
    visible
        Flags (facet,).
    transmitter, receiver
        Antenna positions (3,).
    spreading_reference
        Range at which the spreading is 1, m; 0 for none.
    turns_per_metre
        Cycles of the middle frequency per metre of path.
    steps_per_metre
        Cycles of the frequency step per metre of path.
    taps
        Bins that a facet reaches: 4 for cubic splines, 6 for those of fifth degree and phases that
        are finer accordingly.
    copies
        Copies of the bins (copy, bin), complex64, all 0 before and after. Neighbouring facets share
        bins, and an addition would wait for the one before: so they take turns with 1 copy or
        another power of two.
    bins
        Output: one period of the frequency step in even bins, then `MOST_TAPS` more into which the
        last ones spill, complex64. A facet in bin k adds to k and the next ones.
    """
    parts = copies.view(np.float32).reshape(-1)
    turns, apart = np.uint64(copies.shape[0] - 1), np.uint64(bins.size)
    nearest, furthest = np.int32(bins.size), np.int32(0)
    period = float(bins.size - MOST_TAPS)
    monostatic = (
        transmitter[0] == receiver[0]
        and transmitter[1] == receiver[1]
        and transmitter[2] == receiver[2]
    )
    # Monostatic, the way back is the way out.
    ways = 2 if monostatic else 1
    turns_per_out, steps_per_out = ways * turns_per_metre, ways * steps_per_metre
    out_buffer, back_buffer = scratch.doubles(), scratch.doubles()
    turn, fraction, index = scratch.floats(), scratch.floats(), scratch.integers()
    weight, real, imag = scratch.floats(), scratch.floats(), scratch.floats()
    for begin in range(0, amplitude.size, scratch.SIZE):
        size = min(scratch.SIZE, amplitude.size - begin)
        out, back = out_buffer[:size], back_buffer[:size]
        distances(out, facets, begin, transmitter)
        if monostatic:
            back = out
        else:
            distances(back, facets, begin, receiver)
        for i in range(size):
            weight[i] = amplitude[begin + i] if visible[begin + i] else np.float32(0)
        if spreading_reference > 0:
            for i in range(size):
                ratio = spreading_reference * spreading_reference / (out[i] * back[i])
                weight[i] *= np.float32(ratio)
        if not monostatic:
            for i in range(size):
                out[i] += back[i]
        for i in range(size):
            cycles = out[i] * turns_per_out
            turn[i] = np.float32(np.floor(cycles + 0.5) - cycles)
        for i in range(size):
            steps = out[i] * steps_per_out
            place = (steps - np.floor(steps)) * period
            floor = np.floor(place)
            fraction[i] = np.float32(place - floor)
            index[i] = np.int32(floor)
        for i in range(size):
            nearest, furthest = min(nearest, index[i]), max(furthest, index[i])
        if taps == 4:
            for i in range(size):
                cosine, sine = phasor(turn[i])
                real[i], imag[i] = weight[i] * cosine, weight[i] * sine
            for i in range(size):
                k = np.uint64(i)
                place = (k & turns) * apart + np.uint64(index[k])
                _add_to_four(parts, np.int64(place), fraction[k], real[k], imag[k])
        else:
            for i in range(size):
                cosine, sine = fine_phasor(turn[i])
                real[i], imag[i] = weight[i] * cosine, weight[i] * sine
            for i in range(size):
                k = np.uint64(i)
                place = (k & turns) * apart + np.uint64(index[k])
                _add_to_six(parts, np.int64(place), fraction[k], real[k], imag[k])
    for copy in copies:
        for i in range(nearest, furthest + taps):
            bins[i] += copy[i]
            copy[i] = 0
