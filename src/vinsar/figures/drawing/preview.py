"""What imported echoes look like: range profiles over the positions, and the spectrum."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from vinsar.figures.drawing import style
from vinsar.radar import waveform

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    Floats = NDArray[np.floating]
    Complexes = NDArray[np.complexfloating]

_RANGE_DB = 50.0

# More range cells and positions than these no page shows.
_MOST_CELLS, _MOST_POSITIONS = 2000, 1000


def draw(
    samples: Complexes, frequency: Floats, *, near_range_m: float = 0.0, title: str = ""
) -> Figure:
    """Draw range profiles over the positions, and the mean spectrum, of each channel.

    Parameters
    ----------
    samples
        Echo (channel, position, frequency).
    frequency
        Frequencies, Hz.
    near_range_m
        Range from which the unambiguous range is shown, m.
    title
        What is shown.

    Returns
    -------
    matplotlib.figure.Figure
        The figure.
    """
    with style.applied():
        return _drawn(samples, frequency, near_range_m, title)


def _drawn(samples: Complexes, frequency: Floats, near_range_m: float, title: str) -> Figure:
    from scipy import fft

    channels, positions, count = samples.shape
    step = float(frequency[-1] - frequency[0]) / (count - 1)
    unambiguous = waveform.unambiguous_range(step)
    length = min(4 * count, max(count, _MOST_CELLS))
    every = -(-positions // _MOST_POSITIONS)
    weights = waveform.window("hann", count)
    figure = style.new_figure(style.TWO_COLUMNS_MM, 8.0 + 62.0 * channels)
    style.write_title(figure, 14.0, 62.0 * channels + 4.0, title)
    for channel in range(channels):
        bottom = 12.0 + 62.0 * (channels - 1 - channel)
        profile = np.abs(fft.ifft(samples[channel, ::every] * weights, length, norm="forward"))
        # From the near range on: the transform begins at a multiple of the unambiguous range.
        first = int(np.ceil(near_range_m / unambiguous * length))
        level = 20 * np.log10(np.maximum(np.roll(profile, -(first % length), axis=-1), 1e-30))
        axes = style.place(figure, 14.0, bottom, 96.0, 44.0)
        begin = first * unambiguous / length
        shown = axes.imshow(
            level.T,
            origin="lower",
            aspect="auto",
            extent=(0, positions, begin, begin + unambiguous),
            vmin=level.max() - _RANGE_DB,
            vmax=level.max(),
            cmap=style.colormap("cmc.batlow"),
            interpolation="nearest",
        )
        axes.set_xlabel("position")
        axes.set_ylabel("slant range (m)")
        bar = figure.colorbar(shown, ax=axes, pad=0.02)
        bar.set_label("amplitude (dB)")
        axes = style.place(figure, 130.0, bottom, 44.0, 44.0)
        mean = np.sqrt((np.abs(samples[channel]) ** 2).mean(axis=0))
        axes.plot(frequency / 1e9, 20 * np.log10(np.maximum(mean, 1e-30) / max(mean.max(), 1e-30)))
        axes.set_xlabel("frequency (GHz)")
        axes.set_ylabel("mean spectrum (dB)")
    return figure
