"""What kind of height each cell has: known, in shadow, laid over, or off by whole cycles.

From the data alone; three signs tell what a standard deviation does not.

* **Power.** Ground in shadow returns nothing but sidelobes of its surroundings.
* **Geometry.** What stands before a shadow of length d at the distance y is about ``H d / (y + d)``
  high, H the antenna's height: if the height there is half a cycle less, it has lost one. What
  known heights hide from an antenna is in shadow.
* **Split band.** The outer thirds of the band see phases in the ratio of their frequencies. Their
  difference, with the absolute phase taken away, is whole cycles times that ratio.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from vinsar.processing import phases, uncertainty
from vinsar.radar import aperture, grid

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    Flags = NDArray[np.bool_]
    Floats = NDArray[np.floating]
    Complexes = NDArray[np.complexfloating]

CLASSES = ("valid", "shadow", "layover", "uncertain_cycle", "incoherent", "outside")
"""Classes of a cell, by their number."""

VALID, SHADOW, LAYOVER, UNCERTAIN_CYCLE, INCOHERENT, OUTSIDE = range(len(CLASSES))

# Windows of so many looks, so many times longer in y than in x, and the coherent power of a shadow
# in them against its surroundings, dB: a square, one as wide as the narrowest shadow that is told,
# and one for a pit of eight cells by three. Speckle alone does so once in 1e5, at most in 5e4.
_SHADOW = ((15.0, 1, -6.0), (15.0, 3, -6.0), (10.0, 1, -7.5))

# A shadow ends where the power of a small window is nearly that of lit ground.
_EDGE = 10 ** (-1.5 / 10)
_EDGE_LOOKS = 5.0

# Side of the surroundings, in square roots of resolution cells; their median is lit ground.
_SURROUNDINGS_LOOKS = 700.0
_LEAST_BACKGROUND = 0.3
# Values along the side of the surroundings that go into their median; every so many have one.
_NODES, _APART = 12, 2

# Windows of the split band: wrong by half a cycle at three standard deviations in the first.
SPLIT_LOOKS = (22.0, 85.0)
# Cycles from which a contradiction counts in either, and how many standard deviations it takes.
_SPLIT_CYCLES = (0.5, 0.35)
_SPLIT_SIGNIFICANT = 3.0
# Its region grows as far as the contradiction is probable.
_GROWN_CYCLES, _GROWN_SIGNIFICANT = 0.35, 1.3
# Cycles that the band must say of what stands before too long a shadow.
_BEFORE_SHADOW = 0.2

# With a standard deviation of a radian a phase is half a cycle off at three of them.
_MOST_VARIANCE = 1.0

# Heights this many standard deviations below a line of sight are hidden.
_HIDDEN = 2.0

_TINY = float(np.finfo(float).tiny)


def shadow(product: Complexes, *, cells: uncertainty.Cells) -> Flags:
    """Return which pixels are dark against their surroundings.

    Windows whose coherent power is 6 dB and more down, without the lit pixels at their edges. The
    coherent power is that of the interferogram's mean, to which thermal noise adds little.

    Parameters
    ----------
    product
        Interferogram (y, x), unfiltered.
    cells
        Resolution cells and pixels.

    Returns
    -------
    ndarray of bool, shape (y, x)
        True in shadow, or where nothing scatters.
    """
    from scipy.ndimage import binary_propagation

    shapes = [cells.window(looks, elongation=longer) for looks, longer, _ in _SHADOW]
    powers = [np.abs(uncertainty.mean(product, shape)) for shape in shapes]
    usual = np.maximum(
        _surroundings(powers[0], cells.window(_SURROUNDINGS_LOOKS)),
        max(_LEAST_BACKGROUND * float(np.median(powers[0])), _TINY),
    )
    dark = np.zeros(product.shape, bool)
    for power, shape, (*_, level) in zip(powers, shapes, _SHADOW, strict=True):
        dark |= grow(power < 10 ** (level / 10) * usual, shape)
    lit = np.abs(uncertainty.mean(product, cells.window(_EDGE_LOOKS))) > _EDGE * usual
    return np.asarray(~binary_propagation(~dark, mask=~dark | lit))


def _surroundings(values: Floats, window_px: tuple[int, int]) -> Floats:
    """Return the median of a window around each pixel, from a few of its values."""
    steps = [max(1, side // _NODES) for side in window_px]
    reach = [side // step // 2 for side, step in zip(window_px, steps, strict=True)]
    few = values[:: steps[0], :: steps[1]]
    around = np.pad(few, [(part, part) for part in reach], mode="symmetric")
    windows = np.lib.stride_tricks.sliding_window_view(around, [2 * part + 1 for part in reach])
    nodes = [np.unique(np.append(np.arange(0, size, _APART), size - 1)) for size in few.shape]
    some = windows[np.ix_(*nodes)]
    # Of an odd number of values; rows are sorted faster than their median is selected.
    medians = np.sort(some.reshape(*some.shape[:2], -1), axis=2)[..., windows[0, 0].size // 2]
    for axis, (size, step, node) in enumerate(zip(values.shape, steps, nodes, strict=True)):
        medians = _interpolated(medians, node * step, size, axis)
    return medians


def _interpolated(values: Floats, nodes: NDArray[np.integer], size: int, axis: int) -> Floats:
    """Return values at nodes along one axis interpolated at so many pixels."""
    place = np.interp(np.arange(size), nodes, np.arange(nodes.size))
    before = np.minimum(place.astype(int), max(nodes.size - 2, 0))
    share = np.expand_dims(place - before, 1 - axis)
    first, second = (
        np.take(values, np.minimum(at, nodes.size - 1), axis) for at in (before, before + 1)
    )
    return np.asarray(first + share * (second - first))


def grow(mask: Flags, shape: tuple[int, int]) -> Flags:
    """Return a mask grown by a window (rows, columns) of odd sides around each of its cells."""
    from scipy.ndimage import maximum_filter

    return np.asarray(maximum_filter(mask.view(np.int8), shape, mode="constant").view(bool))


@dataclass(frozen=True)
class Cycles:
    """Cycles that the phase lacks according to the band.

    Attributes
    ----------
    missing
        Cycles (y, x), positive where the height is to be higher.
    std
        Standard deviation (y, x).
    """

    missing: Floats
    std: Floats


def split_band(
    images: Complexes,
    phase: Floats,
    antennas: tuple[aperture.Aperture, aperture.Aperture],
    *,
    x: Floats,
    y: Floats,
    wavelength_m: float,
    cells: uncertainty.Cells,
    relative_bandwidth: float,
    rising: bool,
) -> list[Cycles]:
    """Return the cycles that the outer thirds of the band say the phase lacks.

    Parameters
    ----------
    images
        The two images (2, y, x), focused on the ground plane.
    phase
        Phase of the interferogram with all its cycles, without that of the ground plane (y, x),
        rad.
    antennas
        The two apertures.
    x, y
        Axes, m.
    wavelength_m
        Wavelength of the carrier, m.
    cells
        Resolution cells and pixels, which must be finer in y.
    relative_bandwidth
        Bandwidth over the carrier.
    rising
        Whether the phase rises with the height; with the upper antenna on top it falls (Eq. 1).

    Returns
    -------
    list of Cycles
        One for each window of `SPLIT_LOOKS`. No cycles of infinite standard deviation if the
        pixels are too coarse to hold the band.
    """
    resolution, spacing = cells.resolution, cells.spacing
    if spacing[1] >= float(resolution[1].min()):
        none = Cycles(np.zeros(phase.shape), np.full(phase.shape, np.inf))
        return [none for _ in SPLIT_LOOKS]
    shares = np.array([-1.0, 1.0]) * relative_bandwidth / 3
    parts = []
    for image, part in zip(images, antennas, strict=True):
        # In y a pixel turns by the carrier's path; without that the band lies around 0.
        path = aperture.path(part, x[None, :], y[:, None])
        carrier = phases.rotation(2 * np.pi / wavelength_m * path)
        parts.append(
            _outer_thirds(image * carrier, spacing[1], resolution[1].mean(axis=0), carrier)
        )
    # Of each third the product, and both powers.
    thirds = np.empty((*phase.shape, 2, 4))
    for number, (lower, upper, share) in enumerate(zip(*parts, shares, strict=True)):
        turned = lower * np.conj(upper) * phases.rotation(phase * (1 + share))
        for kind, values in enumerate((turned.real, turned.imag, _power(lower), _power(upper))):
            thirds[..., number, kind] = values
    turn = 2 * np.pi * float(shares[1] - shares[0])
    result = []
    for looks in SPLIT_LOOKS:
        side = cells.window(looks)
        count = cells.extent(side) / (3 * resolution[0] * resolution[1])
        covered = uncertainty.mean(np.ones(phase.shape), side, outside="zero")
        means = uncertainty.mean(thirds.reshape(*phase.shape, -1), side, outside="zero")
        means = np.moveaxis(means.reshape(thirds.shape), (2, 3), (1, 0))
        real, imag, *powers = np.ascontiguousarray(means)
        sums = real + 1j * imag
        squared = (real**2 + imag**2) / np.maximum(powers[0] * powers[1], _TINY)
        squared = np.clip(squared, 0.02**2, 0.9999**2)
        variance = ((1 - squared) / squared).sum(axis=0) / (2 * np.maximum(count * covered, 1))
        lacking = phases.angle(sums[1] * np.conj(sums[0])) / turn
        result.append(Cycles(lacking if rising else -lacking, np.sqrt(variance) / turn))
    return result


def _power(values: Complexes) -> Floats:
    return np.asarray(values.real**2 + values.imag**2)


def _outer_thirds(
    image: Complexes, spacing_m: float, resolution_m: Floats, carrier: Complexes
) -> list[Complexes]:
    """Return an image's parts from the lower and from the upper third of its band."""
    from scipy import fft

    rows = image.shape[0]
    # Room for the response of a third, so that the far edge does not reach the near one.
    padded = fft.next_fast_len(rows + round(6 * float(resolution_m.max()) / spacing_m))
    spectrum = fft.fft(image, padded, axis=0)
    place = fft.fftfreq(padded, spacing_m)[:, None] * resolution_m
    return [
        fft.ifft(spectrum * ((sign * place > 1 / 6) & (sign * place <= 0.51)), axis=0)[:rows]
        * np.conj(carrier)
        for sign in (-1, 1)
    ]


@dataclass(frozen=True)
class Fan:
    """Lines of sight over a grid, seen from above: nearest cells along rays.

    Attributes
    ----------
    antenna
        Where they start (3,), m.
    y
        Axis of the grid, m.
    columns
        Column of each ray in each row (row, ray); -1 where it is beside the grid.
    rays
        Ray through each cell (row, column).
    """

    antenna: Floats
    y: Floats
    columns: NDArray[np.integer]
    rays: NDArray[np.integer]

    @classmethod
    def over(cls, antenna: Floats, x: Floats, y: Floats) -> Fan:
        """Return the fan of an antenna over a grid; two rays a cell at the far edge.

        Raises
        ------
        ValueError
            If the antenna is not before the grid.
        """
        ahead = y - antenna[1]
        if ahead[0] <= 0:
            raise ValueError(
                f"the antenna at y = {antenna[1]:.2f} m is not before the image, which begins at "
                f"y = {y[0]:.2f} m"
            )
        spacing = grid.step(x)
        ends = [(x[side] - antenna[0]) / ahead[row] for side in (0, -1) for row in (0, -1)]
        left, right = min(ends), max(ends)
        count = int(np.ceil(2 * (right - left) * ahead[-1] / spacing)) + 2
        slope = np.linspace(left, right, count)
        column = np.rint((antenna[0] + slope * ahead[:, None] - x[0]) / spacing).astype(np.int32)
        ray = np.rint(((x - antenna[0]) / ahead[:, None] - left) / (slope[1] - slope[0]))
        return cls(
            antenna=antenna,
            y=y,
            columns=np.where((column >= 0) & (column < x.size), column, -1),
            rays=np.clip(ray, 0, count - 1).astype(np.int32),
        )

    def line_of_sight(self, height: Floats, known: Flags) -> Floats:
        """Return the height up to which known heights before it hide each cell, m."""
        from vinsar.kernels import sight

        line = np.where(known, height - self.antenna[2], -np.inf)
        sight.horizon(line, self.columns, self.rays, self.y - self.antenna[1])
        return self.antenna[2] + line

    def too_low(self, dark: Flags, height: Floats, ambiguity: Floats, *, reach_m: float) -> Flags:
        """Return what stands before a shadow and is half a cycle too low for its length.

        Parameters
        ----------
        dark
            Shadow (y, x).
        height
            Heights (y, x), m.
        ambiguity
            Height of ambiguity (y, x), m.
        reach_m
            How far before its shadow something stands, and how long a shadow must be at least, m.

        Returns
        -------
        ndarray of bool, shape (y, x)
            Cells before such shadows.
        """
        from vinsar.kernels import sight

        known = height[np.isfinite(height)]
        found = np.zeros(self.columns.shape, bool)
        sight.too_low(
            dark,
            height,
            ambiguity,
            self.columns,
            self.y - self.antenna[1],
            float(self.antenna[2]),
            float(np.median(known)) if known.size else 0.0,
            max(1, round(reach_m / grid.step(self.y))),
            found,
        )
        return np.asarray(np.take_along_axis(found, self.rays, axis=1))


def uncertain_cycles(
    cycles: Sequence[Cycles], dark: Flags, too_low: Flags, *, window_px: tuple[int, int]
) -> Flags:
    """Return where the phase contradicts the band, or stands too low before its shadow.

    Parameters
    ----------
    cycles
        What the band says, by window (`split_band`), on the grid of the heights.
    dark
        Cells in shadow, which say nothing.
    too_low
        Cells before a shadow that is too long for them.
    window_px
        Rows and columns of the band's first window.

    Returns
    -------
    ndarray of bool, shape (y, x)
        True where the number of cycles is not certain.
    """
    from scipy.ndimage import binary_propagation

    found = np.zeros(dark.shape, bool)
    rows, columns = window_px
    near = 2 * rows - 1, 2 * columns - 1
    # Backwards from the shadow, as deep as what stands there may be.
    deep = 4 * rows + 1, 2 * (columns // 4) + 1
    for sign in (-1, 1):
        first = sign * cycles[0].missing
        probable = ~dark & (first > np.maximum(_GROWN_CYCLES, _GROWN_SIGNIFICANT * cycles[0].std))
        certain = np.zeros(dark.shape, bool)
        for part, least in zip(cycles, _SPLIT_CYCLES, strict=True):
            certain |= sign * part.missing > np.maximum(least, _SPLIT_SIGNIFICANT * part.std)
        certain &= ~dark & (first > _GROWN_CYCLES)
        found |= binary_propagation(certain, mask=certain | (probable & grow(certain, near)))
        if sign > 0:
            likely = ~dark & (first > _BEFORE_SHADOW)
            seeds = too_low & likely
            found |= binary_propagation(seeds, mask=likely & grow(too_low, deep))
    return np.asarray(grow(found, (2 * (rows // 5) + 1, 2 * (columns // 5) + 1)) & ~dark)


def islands(valid: Flags, reference: Flags, cycles: Cycles, *, window_px: tuple[int, int]) -> Flags:
    """Return valid cells that no valid cells connect with the height reference.

    Where the band confirms their cycle at two standard deviations they stay.

    Parameters
    ----------
    valid
        Cells (y, x) whose height is otherwise known.
    reference
        Cells of the height reference.
    cycles
        What the band says of each cell.
    window_px
        Rows and columns of the band's window.

    Returns
    -------
    ndarray of bool, shape (y, x)
        True on islands.
    """
    from scipy.ndimage import label

    areas, count = label(valid, np.ones((3, 3)))
    held = np.unique(areas[reference & valid])
    result = np.zeros(valid.shape, bool)
    for number in range(1, count + 1):
        if number in held:
            continue
        area = areas == number
        windows = max(1.0, area.sum() / (window_px[0] * window_px[1]))
        off = abs(float(cycles.missing[area].mean()))
        error = float(cycles.std[area].mean()) / np.sqrt(windows)
        if not off + 2 * error < 0.5:
            result |= area
    return result


def layover(true_y: Floats, slack_m: Floats) -> Flags:
    """Return pixels that come out before the pixel nearer to the radar: terrain that folds over.

    Parameters
    ----------
    true_y
        Where the pixels belong (y, x), m; NaN where that is not known.
    slack_m
        By how much noise may put them out of order (y, x), m.

    Returns
    -------
    ndarray of bool, shape (y, x)
        True for both pixels of each such pair.
    """
    back = np.diff(true_y, axis=0) < -np.maximum(slack_m[1:], slack_m[:-1])
    result = np.zeros(true_y.shape, bool)
    result[1:] |= back
    result[:-1] |= back
    return result


def classify(
    height: Floats,
    std: Floats,
    *,
    dark: Flags,
    folded: Flags,
    variance: Floats,
    cycles: Sequence[Cycles],
    ambiguity: Floats,
    reference: Flags,
    loose: Flags,
    antennas: Sequence[Floats],
    x: Floats,
    y: Floats,
    window_px: tuple[int, int],
) -> NDArray[np.int8]:
    """Return the class of each cell of a DEM.

    All arrays are on the grid of the DEM (y, x).

    Parameters
    ----------
    height, std
        Heights and their standard deviation, m; NaN where there is none.
    dark
        Cells of pixels in `shadow`.
    folded
        Cells of pixels in `layover`.
    variance
        Variance of the phase by noise alone, rad^2.
    cycles
        What the band says (`split_band`).
    ambiguity
        Height of ambiguity, m.
    reference
        Cells of the height reference.
    loose
        Cells of pixels that no phase connects with it.
    antennas
        Places (3,) of the antennas before the image, m; without any, geometry says nothing.
    x, y
        Axes, m.
    window_px
        Rows and columns of the band's first window.

    Returns
    -------
    ndarray of int8, shape (y, x)
        Index into `CLASSES`.
    """
    fans = [Fan.over(antenna, x, y) for antenna in antennas]
    outside = ~np.isfinite(height)
    reach = max(1, window_px[0] // 2) * grid.step(y)
    low = np.zeros(height.shape, bool)
    if fans:
        lowest = min(fans, key=lambda fan: float(fan.antenna[2]))
        low = lowest.too_low(dark, height, ambiguity, reach_m=reach)
    uncertain = uncertain_cycles(cycles, dark, low, window_px=window_px)
    incoherent = ~(variance <= _MOST_VARIANCE)
    known = ~(outside | dark | uncertain | incoherent | folded)
    # Over a few looks: what single cells hide is noise.
    side = 2 * (window_px[0] // 4) + 1, 2 * (window_px[1] // 4) + 1
    share = uncertainty.mean(known, side)
    smooth = uncertainty.mean(np.where(known, height, 0.0), side) / np.maximum(share, _TINY)
    hidden = np.zeros(height.shape, bool)
    for fan in fans:
        hidden |= fan.line_of_sight(smooth, known) > smooth + _HIDDEN * std
    hidden &= share > 0
    known &= ~hidden
    alone = islands(known, reference, cycles[0], window_px=window_px)
    result = np.full(height.shape, VALID, np.int8)
    result[incoherent] = INCOHERENT
    result[uncertain | alone | loose] = UNCERTAIN_CYCLE
    result[folded] = LAYOVER
    result[dark | hidden] = SHADOW
    result[outside] = OUTSIDE
    return result


def coded(code: Callable[[Floats], Floats], mask: Flags) -> Flags:
    """Return a mask of pixels on the grid of the DEM; cells without a pixel are in it.

    Parameters
    ----------
    code
        From the image's pixels to the DEM's cells (`height.DemCoding`).
    mask
        Pixels (y, x).
    """
    return np.asarray(~(code(mask.astype(float)) < 0.5))
