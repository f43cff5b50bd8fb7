"""One antenna position's part of the matched filter, for pixels in a row: look up, turn, add."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import types
from numba.extending import intrinsic

from vinsar.kernels.compiling import part
from vinsar.kernels.lookup import FLAGS, INTS, LANES, PADDING, Emitter, contiguous, permutes


def _window_adder(pairs: int) -> Any:
    @intrinsic
    def add_window(  # type: ignore[no-untyped-def]
        typingctx, begin, index, base, real, imag, weights, cosine, sine, sum_real, sum_imag
    ):
        """Do what `add` does for `LANES` pixels whose samples lie within one window."""
        del typingctx
        if not contiguous(index, real, imag, weights, cosine, sine, sum_real, sum_imag):
            return None
        arguments_types = (
            begin, index, base, real, imag, weights, cosine, sine, sum_real, sum_imag,
        )  # fmt: skip

        def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
            # Without the instruction it is never reached: there are no pairs then.
            if permutes(context):
                emit = Emitter(context, builder, signature, arguments)
                at = arguments[0]
                taps = weights.count
                parts = emit.array(3), emit.array(4)
                start, places = emit.window(
                    emit.load(emit.array(1), at, INTS), arguments[2], parts[0], pairs
                )
                factors = [emit.load(emit.array(5, tap), at) for tap in range(taps)]
                values = []
                for part_ in parts:
                    found = emit.look_up(part_, start, places, taps, pairs)
                    value = builder.fmul(factors[0], found[0], flags=FLAGS)
                    for factor, sample in zip(factors[1:], found[1:], strict=True):
                        value = emit.fused(factor, sample, value)
                    values.append(value)
                a, b = values
                c, s = emit.load(emit.array(6), at), emit.load(emit.array(7), at)
                reals, imags = emit.array(8), emit.array(9)
                real_ = emit.fused(a, c, emit.load(reals, at))
                turned = builder.fmul(b, s, flags=FLAGS)
                emit.store(builder.fsub(real_, turned, flags=FLAGS), reals, at)
                emit.store(emit.fused(b, c, emit.fused(a, s, emit.load(imags, at))), imags, at)
            return context.get_dummy_value()

        return types.void(*arguments_types), generate

    return add_window


_add_from_pair, _add_from_pairs = _window_adder(1), _window_adder(2)


@part
def add(
    pairs: int,
    index: Any,
    base: int,
    weights: Any,
    cosine: Any,
    sine: Any,
    profile_real: Any,
    profile_imag: Any,
    sum_real: Any,
    sum_imag: Any,
) -> None:
    """Add the interpolated profile, turned by the carrier's phase, to a row of pixels.

    Parameters
    ----------
    pairs, index, base
        As in `lookup.copy`: the first sample of the profile that each pixel reads.
    weights
        For each sample that a pixel reads, in order, its weight (pixel,), float32.
    cosine, sine
        Phasor of the carrier's phase (pixel,), float32.
    profile_real, profile_imag
        The profile (slant range,), float32, with `lookup.PADDING` samples to spare.
    sum_real, sum_imag
        Output (pixel,), float32.
    """
    if pairs == 1:
        for begin in range(0, index.size, LANES):
            _add_from_pair(
                np.int64(begin), index, base, profile_real, profile_imag, weights, cosine, sine,
                sum_real, sum_imag,
            )  # fmt: skip
    elif pairs == 2:
        for begin in range(0, index.size, LANES):
            _add_from_pairs(
                np.int64(begin), index, base, profile_real, profile_imag, weights, cosine, sine,
                sum_real, sum_imag,
            )  # fmt: skip
    else:
        last = profile_real.size - PADDING
        for i in range(index.size):
            # Unsigned, so that no negative index needs a look.
            k = np.uint64(min(max(base + index[i], 0), last))
            a = weights[0][i] * profile_real[k]
            b = weights[0][i] * profile_imag[k]
            for tap in range(1, len(weights)):
                a += weights[tap][i] * profile_real[k + np.uint64(tap)]
                b += weights[tap][i] * profile_imag[k + np.uint64(tap)]
            sum_real[i] += a * cosine[i] - b * sine[i]
            sum_imag[i] += a * sine[i] + b * cosine[i]
