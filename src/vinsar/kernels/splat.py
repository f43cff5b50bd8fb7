"""Echoes of facets spread over range bins by cubic B-splines: the adjoint of back-projection.

Each facet, turned by its phase at the middle frequency, adds to the four range bins around it. A
Fourier transform of the bins, divided by the splines' sinc^4, then is the echo: what interpolating
back-projection does, transposed, with the same error.
"""

from __future__ import annotations

import numpy as np

from vinsar.kernels.compiling import kernel
from vinsar.kernels.functions import phasor, spline
from vinsar.kernels.paths import distances

TAPS = 4
"""Range bins that a facet reaches: bins beyond the last one needed."""

_CHUNK = 512


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
    bins
        Output: one period of the frequency step in even bins, then `TAPS` more into which the last
        ones spill, complex64. A facet in bin k adds to k and the three after it.
    """
    parts = bins.view(np.float32)
    period = float(bins.size - TAPS)
    monostatic = (
        transmitter[0] == receiver[0]
        and transmitter[1] == receiver[1]
        and transmitter[2] == receiver[2]
    )
    out_buffer, back_buffer = np.empty(_CHUNK), np.empty(_CHUNK)
    turn = np.empty(_CHUNK, np.float32)
    fraction = np.empty(_CHUNK, np.float32)
    index = np.empty(_CHUNK, np.int32)
    weight = np.empty(_CHUNK, np.float32)
    real = np.empty(_CHUNK, np.float32)
    imag = np.empty(_CHUNK, np.float32)
    first = np.empty(_CHUNK, np.float32)
    second = np.empty(_CHUNK, np.float32)
    third = np.empty(_CHUNK, np.float32)
    fourth = np.empty(_CHUNK, np.float32)
    for begin in range(0, amplitude.size, _CHUNK):
        size = min(_CHUNK, amplitude.size - begin)
        out, back = out_buffer[:size], back_buffer[:size]
        distances(out, facets, begin, transmitter)
        if monostatic:
            back[:] = out
        else:
            distances(back, facets, begin, receiver)
        if spreading_reference > 0:
            for i in range(size):
                ratio = spreading_reference * spreading_reference / (out[i] * back[i])
                weight[i] = amplitude[begin + i] * np.float32(ratio)
        else:
            weight[:size] = amplitude[begin : begin + size]
        for i in range(size):
            path = out[i] + back[i]
            turns = path * turns_per_metre
            turn[i] = np.float32(np.floor(turns + 0.5) - turns)
            steps = path * steps_per_metre
            place = (steps - np.floor(steps)) * period
            floor = np.floor(place)
            fraction[i] = np.float32(place - floor)
            index[i] = np.int32(floor)
        for i in range(size):
            cosine, sine = phasor(turn[i])
            real[i], imag[i] = weight[i] * cosine, weight[i] * sine
            first[i], second[i], third[i], fourth[i] = spline(fraction[i])
        for i in range(size):
            if visible[begin + i]:
                w0, w1, w2, w3 = first[i], second[i], third[i], fourth[i]
                a, b = real[i], imag[i]
                # Unsigned, so that no negative index needs a look.
                k = np.uint64(2 * index[i])
                parts[k] += w0 * a
                parts[k + np.uint64(1)] += w0 * b
                parts[k + np.uint64(2)] += w1 * a
                parts[k + np.uint64(3)] += w1 * b
                parts[k + np.uint64(4)] += w2 * a
                parts[k + np.uint64(5)] += w2 * b
                parts[k + np.uint64(6)] += w3 * a
                parts[k + np.uint64(7)] += w3 * b
