"""One antenna position's part of the matched filter, for pixels in a row: look up, turn, add."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import config, types
from numba.extending import intrinsic

from vinsar.kernels.compiling import part
from vinsar.kernels.lookup import Emitter, contiguous, lanes


def _adder(windows: int) -> Any:
    @intrinsic
    def add_group(  # type: ignore[no-untyped-def]
        typingctx, begin, index, base, real, imag, weights, cosine, sine, sum_real, sum_imag
    ):
        """Do what `add` does for a group of pixels, from a window or from single samples."""
        del typingctx
        if not contiguous(index, real, imag, weights, cosine, sine, sum_real, sum_imag):
            return None
        arguments_types = (
            begin, index, base, real, imag, weights, cosine, sine, sum_real, sum_imag,
        )  # fmt: skip

        def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
            emit = Emitter(context, builder, signature, arguments, 0 if windows else 8)
            if not emit.has(windows):
                return context.get_dummy_value()
            at, indices, taps = arguments[0], emit.array(1), 4 if weights.count == 4 else 2
            parts = emit.array(3), emit.array(4)
            if windows:
                start, places = emit.window(
                    emit.load(indices, at, emit.ints), arguments[2], parts[0], taps, windows
                )
                looked_up = [emit.look_up(one, start, places, taps, windows) for one in parts]
            else:
                looked_up = [emit.gather(one, indices, at, arguments[2], taps) for one in parts]
            factors = [emit.load(emit.array(5, item), at) for item in range(weights.count)]
            values = []
            for found in looked_up:
                if taps == 2:
                    value = emit.fused(factors[0], emit.minus(found[1], found[0]), found[0])
                else:
                    value = emit.times(factors[0], found[0])
                    for factor, sample in zip(factors[1:], found[1:], strict=True):
                        value = emit.fused(factor, sample, value)
                values.append(value)
            a, b = values
            c, s = emit.load(emit.array(6), at), emit.load(emit.array(7), at)
            reals, imags = emit.array(8), emit.array(9)
            real_ = emit.fused(a, c, emit.load(reals, at))
            emit.store(emit.minus(real_, emit.times(b, s)), reals, at)
            emit.store(emit.fused(b, c, emit.fused(a, s, emit.load(imags, at))), imags, at)
            return context.get_dummy_value()

        return types.void(*arguments_types), generate

    return add_group


_add_singles, _add_from_one, _add_from_two = (_adder(windows) for windows in range(3))

if config.DISABLE_JIT:  # Then the kernels are plain Python.

    def _add_singles(  # type: ignore[no-untyped-def]
        begin, index, base, real, imag, weights, cosine, sine, sum_real, sum_imag
    ):
        group = slice(begin, begin + 8)
        places = base + index[group].astype(np.int64)
        samples = [real[places + tap] + 1j * imag[places + tap] for tap in range(4)]
        if len(weights) == 1:
            value = samples[0] + weights[0][group] * (samples[1] - samples[0])
        else:
            value = sum(w[group] * sample for w, sample in zip(weights, samples, strict=True))
        turned = value * (cosine[group] + 1j * sine[group])
        sum_real[group] += turned.real
        sum_imag[group] += turned.imag


@part
def add(
    windows: int,
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
    windows
        From `lookup.windows_for`, for all groups.
    index
        The first sample of the profile that each pixel reads, less the base (pixel,), int32, a
        multiple of `lookup.LANES`.
    base
        What to add to them, int64. The sums must lie within the profile, except for
        `lookup.PADDING`.
    weights
        The weights of the four samples that a pixel reads, or only that of the second of two, the
        first having the rest: tuple of (pixel,), float32.
    cosine, sine
        Phasor of the carrier's phase (pixel,), float32.
    profile_real, profile_imag
        The profile (slant range,), float32, with `lookup.PADDING` samples to spare.
    sum_real, sum_imag
        Output (pixel,), float32.
    """
    if windows == 1:
        for begin in range(0, index.size, lanes()):
            _add_from_one(
                np.int64(begin), index, base, profile_real, profile_imag, weights, cosine, sine,
                sum_real, sum_imag,
            )  # fmt: skip
    elif windows == 2:
        for begin in range(0, index.size, lanes()):
            _add_from_two(
                np.int64(begin), index, base, profile_real, profile_imag, weights, cosine, sine,
                sum_real, sum_imag,
            )  # fmt: skip
    else:
        for begin in range(0, index.size, 8):
            _add_singles(
                np.int64(begin), index, base, profile_real, profile_imag, weights, cosine, sine,
                sum_real, sum_imag,
            )  # fmt: skip
