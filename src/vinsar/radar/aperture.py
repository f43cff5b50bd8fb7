"""Where an aperture images a target, for any lines of transmitter and receiver.

An aperture is two straight lines, ``T + a_T u`` of the transmitter and ``R + a_R u`` of the
receiver, with u from -1/2 to 1/2: on a rail both are one, in a switched array the transmitter
stands still, on a moving vehicle the line is turned. At its centre the path out and back and the
path's slope along the aperture are

    path(P) = |P - T| + |P - R|,    slope(P) = -a_T . (P - T) / |P - T| - a_R . (P - R) / |P - R|.

A target is imaged at the point of the ground plane of the same path and slope. Around a rail along
x these points lie on a circle, exactly and from every position (`geometry.circle_image_y`);
otherwise on an ellipse, whose foci are T and R, from the aperture's centre and to first order.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from vinsar.radar import geometry

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike, NDArray

    Floats = NDArray[np.floating]

# Coordinates closer than this are the same: a millionth of a cycle.
_SAME_M = 1e-9

# Departures of fewer standard errors are due to the scatter of the positions.
_SIGNIFICANT = 5.0

_MOST_STEPS = 20
_CONVERGED_M = 1e-9


@dataclass(frozen=True)
class Aperture:
    """The two straight lines of one channel.

    Attributes
    ----------
    transmitter, receiver
        Centre of each line (3,), m.
    transmitter_travel, receiver_travel
        From its first to its last position (3,), m.
    uncertainty_m
        Standard error of the centre along x by the positions' scatter around the line, m.
    """

    transmitter: Floats
    receiver: Floats
    transmitter_travel: Floats
    receiver_travel: Floats
    uncertainty_m: float = 0.0

    @property
    def center(self) -> Floats:
        """Midpoint (3,) between transmitter and receiver, m."""
        return (self.transmitter + self.receiver) / 2

    @property
    def monostatic(self) -> bool:
        """Whether one antenna transmits and receives."""
        return bool(
            np.abs(self.transmitter - self.receiver).max() < _SAME_M
            and np.abs(self.transmitter_travel - self.receiver_travel).max() < _SAME_M
        )

    @property
    def rail(self) -> bool:
        """Whether one antenna runs along x."""
        return self.monostatic and not self.receiver_travel[1:].any()


def fit(transmitter: ArrayLike, receiver: ArrayLike) -> Aperture:
    """Return the aperture of some antenna positions: straight lines by least squares.

    A travel along an axis within the standard error of the positions' scatter counts as none:
    positions with random errors do not rotate a rail.

    Parameters
    ----------
    transmitter, receiver
        Positions (position, 3), m.

    Returns
    -------
    Aperture
        The lines.
    """
    (out, out_travel, error), (back, back_travel, back_error) = (
        _line(np.ascontiguousarray(positions, float).tobytes())
        for positions in (transmitter, receiver)
    )
    # One antenna is both ends: its errors are the same, and their mean no smaller.
    return Aperture(out, back, out_travel, back_travel, max(error, back_error))


# Stage after stage asks for the lines of the same positions.
@lru_cache(maxsize=64)
def _line(data: bytes) -> tuple[Floats, Floats, float]:
    """Return centre, travel and standard error along x of positions (position, 3), as bytes."""
    positions = np.frombuffer(data).reshape(-1, 3)
    count = len(positions)
    along = np.linspace(-0.5, 0.5, count) if count > 1 else np.zeros(1)
    power = float(along @ along) or 1.0
    center = positions.mean(axis=0)
    travel = along @ (positions - center) / power
    rest = positions - center - along[:, None] * travel
    scatter = np.sqrt((rest**2).sum(axis=0) / max(count - 2, 1))
    least = np.maximum(_SIGNIFICANT * scatter / np.sqrt(power), _SAME_M)
    travel = np.where(np.abs(travel) > least, travel, 0.0)
    for shared in (center, travel):
        shared.flags.writeable = False
    return center, travel, float(scatter[0]) / np.sqrt(count)


def path(aperture: Aperture, x: ArrayLike, y: ArrayLike, z: ArrayLike = 0.0) -> Floats:
    """Return the path out and back from the aperture's centre to points, m.

    Parameters
    ----------
    aperture
        The aperture.
    x, y, z
        Points, m, of shapes that broadcast.

    Returns
    -------
    ndarray
        Length of the path, m; twice the slant range of a monostatic antenna.
    """
    out = geometry.slant_range(aperture.transmitter, x, y, z)
    if aperture.monostatic:
        return 2 * out
    return out + geometry.slant_range(aperture.receiver, x, y, z)


def interferometric_phase(
    lower: Aperture,
    upper: Aperture,
    x: ArrayLike,
    y: ArrayLike,
    z: ArrayLike,
    wavelength_m: float,
) -> Floats:
    """Return the absolute interferometric phase of targets, rad.

    ``phi = -2 pi (path_1 - path_2) / lambda``: Eq. 1 on a rail; with a pair of transmitters and
    common receivers, half of it, ``-2 pi (r_tx1 - r_tx2) / lambda``.

    Parameters
    ----------
    lower, upper
        The two apertures.
    x, y, z
        Targets, m, of shapes that broadcast.
    wavelength_m
        Wavelength, m.

    Returns
    -------
    ndarray
        Phase, lower minus upper, rad.
    """
    difference = path(lower, x, y, z) - path(upper, x, y, z)
    return -2 * np.pi * difference / wavelength_m


def flat_earth_phase(
    lower: Aperture, upper: Aperture, x: ArrayLike, y: ArrayLike, wavelength_m: float
) -> Floats:
    """Return the phase of the ground plane, which focusing on it has removed (Eq. 11), rad.

    Parameters
    ----------
    lower, upper
        The two apertures.
    x, y
        Points on the ground plane, m, of shapes that broadcast.
    wavelength_m
        Wavelength, m.

    Returns
    -------
    ndarray
        Phase, lower minus upper, rad.
    """
    return interferometric_phase(lower, upper, x, y, 0.0, wavelength_m)


def image_position(
    aperture: Aperture, x: ArrayLike, y: ArrayLike, z: ArrayLike
) -> tuple[Floats, Floats]:
    """Return where on the ground plane targets are imaged: where path and slope are the same.

    Parameters
    ----------
    aperture
        The aperture.
    x, y, z
        Targets, m, of shapes that broadcast.

    Returns
    -------
    tuple of ndarray
        x and y on the ground plane, m; NaN where no such point is found.
    """
    x, y, z = np.broadcast_arrays(*(np.asarray(values, float) for values in (x, y, z)))
    if aperture.rail:
        ahead, height = aperture.center[1:]
        return x.copy(), ahead + geometry.circle_image_y(y - ahead, z, float(height))
    target = np.stack([x.ravel(), y.ravel(), z.ravel()])
    (wanted_path, _), (wanted_slope, _) = _path(aperture, target), _slope(aperture, target)

    def equations(points: Floats) -> tuple[Floats, Floats]:
        length, along = _path(aperture, points)
        slope, across = _slope(aperture, points)
        gradients = np.stack([along, across, np.zeros_like(along)])
        # The third equation keeps the point on the ground.
        gradients[2, 2] = 1.0
        return np.stack([length - wanted_path, slope - wanted_slope, points[2]]), gradients

    start = target * np.array([[1.0], [1.0], [0.0]])
    found = _newton(equations, start)
    return found[0].reshape(x.shape), found[1].reshape(x.shape)


def locate(
    lower: Aperture,
    upper: Aperture,
    x: ArrayLike,
    y: ArrayLike,
    phase: ArrayLike,
    wavelength_m: float,
) -> tuple[Floats, Floats, Floats]:
    """Return the targets that are imaged at pixels with an absolute interferometric phase.

    The point whose path and slope are the pixel's for the lower aperture, and whose difference of
    paths ``path_1 - path_2`` is ``-lambda phi / 2 pi``. For two antennas above each other on a rail
    this is `geometry.invert_height`, in closed form; otherwise Newton's method, from the ground.

    Parameters
    ----------
    lower, upper
        The two apertures; the pixels are those of the lower one's image.
    x, y
        Pixels on the ground plane, m, of shapes that broadcast.
    phase
        Absolute phase, flat-earth phase included, rad.
    wavelength_m
        Wavelength, m.

    Returns
    -------
    tuple of ndarray
        x, y and height of the targets, m; NaN where no target has this phase.
    """
    x, y, phase = np.broadcast_arrays(*(np.asarray(values, float) for values in (x, y, phase)))
    if _above_each_other(lower, upper):
        start, ahead, height = lower.center
        across, up = (upper.center - lower.center)[1:]
        found = geometry.invert_height(
            geometry.slant_range(lower.center, x, y),
            phase,
            baseline_m=float(np.hypot(across, up)),
            baseline_angle=float(np.arctan2(up, across)),
            antenna_height=float(height),
            along_track=x - start,
            wavelength_m=wavelength_m,
        )
        return x.copy(), ahead + geometry.circle_true_y(y - ahead, found, float(height)), found
    pixels = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    (wanted_path, _), (wanted_slope, _) = _path(lower, pixels), _slope(lower, pixels)
    wanted_difference = -wavelength_m * phase.ravel() / (2 * np.pi)

    def equations(points: Floats) -> tuple[Floats, Floats]:
        length, along = _path(lower, points)
        other, other_along = _path(upper, points)
        slope, across = _slope(lower, points)
        return (
            np.stack(
                [length - wanted_path, slope - wanted_slope, length - other - wanted_difference]
            ),
            np.stack([along, across, along - other_along]),
        )

    place = _newton(equations, pixels).reshape(3, *x.shape)
    return place[0], place[1], place[2]


def _above_each_other(lower: Aperture, upper: Aperture) -> bool:
    # Recorded positions with errors of their own differ along x by what the errors make.
    apart = abs(float(lower.center[0] - upper.center[0]))
    by_chance = _SIGNIFICANT * float(np.hypot(lower.uncertainty_m, upper.uncertainty_m))
    return lower.rail and upper.monostatic and apart < by_chance + _SAME_M


def _path(aperture: Aperture, points: Floats) -> tuple[Floats, Floats]:
    """Return the path to points (3, n) and its gradient (3, n)."""
    length, gradient = _range(aperture.transmitter, points)
    if aperture.monostatic:
        return 2 * length, 2 * gradient
    back, gradient_back = _range(aperture.receiver, points)
    return length + back, gradient + gradient_back


def _range(end: Floats, points: Floats) -> tuple[Floats, Floats]:
    """Return the distance of points (3, n) from one end of the path, and its gradient (3, n)."""
    step = points - end[:, None]
    distance = np.sqrt(step[0] ** 2 + step[1] ** 2 + step[2] ** 2)
    step /= distance
    return distance, step


def _slope(aperture: Aperture, points: Floats) -> tuple[Floats, Floats]:
    """Return the path's slope at points (3, n) and its gradient (3, n)."""
    ends = [
        (aperture.transmitter, aperture.transmitter_travel),
        (aperture.receiver, aperture.receiver_travel),
    ]
    if aperture.monostatic:
        ends = [(ends[0][0], 2 * ends[0][1])]
    slope, gradient = np.zeros(points.shape[1]), np.zeros_like(points)
    for end, travel in ends:
        if travel.any():
            distance, step = _range(end, points)
            along = travel @ step
            slope -= along
            step *= along
            step -= travel[:, None]
            step /= distance
            gradient += step
    return slope, gradient


def gradients(
    aperture: Aperture, x: ArrayLike, y: ArrayLike, z: ArrayLike = 0.0
) -> tuple[Floats, Floats]:
    """Return the gradients of path and slope at points: what resolution follows from.

    Parameters
    ----------
    aperture
        The aperture.
    x, y, z
        Points, m, of shapes that broadcast.

    Returns
    -------
    tuple of ndarray, shape (3, ...)
        Gradient of the path, and of its change from the first to the last position, m/m.
    """
    x, y, z = np.broadcast_arrays(*(np.asarray(values, float) for values in (x, y, z)))
    points = np.stack([x.ravel(), y.ravel(), z.ravel()])
    shape = (3, *x.shape)
    return _path(aperture, points)[1].reshape(shape), _slope(aperture, points)[1].reshape(shape)


def cross(a: Floats, b: Floats) -> Floats:
    """Return the cross products of vectors (3, ...); numpy's takes several times as long."""
    return np.stack(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    )


def _newton(equations: Callable[[Floats], tuple[Floats, Floats]], start: Floats) -> Floats:
    """Solve three equations at each of many points, by Newton's method; NaN without a solution.

    `equations` takes points (3, n) to residuals (3, n) and their gradients (3, 3, n).
    """
    points = start.copy()
    with np.errstate(all="ignore"):
        for _ in range(_MOST_STEPS):
            residual, (a, b, c) = equations(points)
            across = cross(b, c), cross(c, a), cross(a, b)
            volume = (a * across[0]).sum(axis=0)
            step = sum(value * normal for value, normal in zip(residual, across, strict=True))
            step /= volume
            points -= step
            size = np.abs(step).max(axis=0)
            if not np.any(size > _CONVERGED_M):
                break
    # The last step of one that converges is the square of the one before it.
    return np.where(size <= _CONVERGED_M, points, np.nan)
