"""What a configuration will do, predicted from its geometry and waveform without running it.

Resolution, ambiguities and what an error of a path does to a height are the instrument's
(`vinsar.radar.instrument`), for any arrangement of antennas; here they meet scene, image and noise.
On the paper's rail the errors of the baseline are Eqs. 5 and 12 with their exact terms.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from vinsar.foundations import tables
from vinsar.foundations.constants import AXES
from vinsar.radar import aperture, instrument, speckle, trajectory
from vinsar.radar.instrument import Instrument
from vinsar.study import validation

if TYPE_CHECKING:
    from collections.abc import Mapping

    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

    from vinsar.foundations.configuration import Study
    from vinsar.processing.focusing import Imaging
    from vinsar.simulation.scene import Scene

    Floats = NDArray[np.floating]

SECTIONS = (
    "radar",
    "scene",
    "measurement",
    "echo",
    "suppression",
    "imaging",
    "interferogram",
    "height",
    "accuracy",
)
"""Parts of the configuration that `Sheet` reads."""

PLACES = ("near", "middle", "far")

OF_95_PERCENT = 1.96
"""95 % of a normal distribution lie within this many standard deviations."""

# Up to what share of a resolution cell the images may be shifted against each other.
_REGISTRATION_SHARE = 0.1

_RANGE_SHARE, _WIDTH_SHARE = 0.9, 0.7
_SIDELOBES_DB = -10.0
_SAME_M = 1e-9
_BYTES_PER_SAMPLE = 8


@dataclass(frozen=True)
class Tolerance:
    """What an error of the geometry does to heights, and how large it may be.

    Attributes
    ----------
    name
        The error.
    unit
        Unit of the error.
    per_unit
        Height error per unit at `PLACES`, m.
    tolerated
        Error that moves a height of the image by the tolerance, at most.
    tolerated_referenced
        The same after the height reference has taken its phase constant.
    """

    name: str
    unit: str
    per_unit: Floats
    tolerated: float
    tolerated_referenced: float


@dataclass(frozen=True)
class Sheet:
    """The predictions for a study.

    Attributes
    ----------
    study
        The configuration, or `SECTIONS` of it.
    """

    study: Study

    @cached_property
    def antennas(self) -> xr.Dataset:
        """Product ``trajectory``."""
        return trajectory.planned(self.study.radar)

    @cached_property
    def instrument(self) -> Instrument:
        """What follows from antennas and waveform alone."""
        return Instrument.planned(self.study.radar)

    @property
    def farthest_range(self) -> float:
        """Farthest slant range of scene and image, m."""
        corners = [
            trajectory.range_extent(
                self.antennas,
                np.array([part.x_min_m, part.x_max_m]),
                np.array([part.y_min_m, part.y_max_m]),
            )[1]
            for part in (self.scene, self.study.imaging)
        ]
        return max(corners)

    @property
    def samples(self) -> int:
        """Samples of a scan."""
        return 2 * self.instrument.positions * self.instrument.frequency.size

    @property
    def scan_duration(self) -> float:
        """Duration of a scan, s."""
        return trajectory.scan_duration(self.study.radar, self.study.vehicle, self.samples)

    @property
    def scene(self) -> Scene | Imaging:
        """What scatters: the scene, or the image's ground where echoes are measured."""
        measured = self.study.measurement.file is not None
        return self.study.imaging if measured else self.study.scene

    @property
    def relief(self) -> float:
        """Height of the scene's highest obstacle or top, m; of `peaks` where none is declared."""
        part = self.study.scene
        heights = [float(getattr(item, "height_m", 0.0)) for item in part.objects]
        if part.terrain != "flat" or not any(heights):
            heights.append(part.peak_height_m)
        return max(heights)

    @property
    def x(self) -> float:
        """Middle of the image along x, m."""
        return (self.study.imaging.x_min_m + self.study.imaging.x_max_m) / 2

    @property
    def places(self) -> Floats:
        """The image's near edge, middle and far edge, y in m."""
        part = self.study.imaging
        return np.array([part.y_min_m, (part.y_min_m + part.y_max_m) / 2, part.y_max_m])

    def snr_db(self, y: ArrayLike) -> Floats:
        """Return the signal-to-noise ratio of a range cell, dB; infinite without noise."""
        part = self.study.echo
        y = np.asarray(y, float)
        if part.snr_db is None:
            return np.full(y.shape, np.inf)
        if not part.spreading:
            return np.full(y.shape, part.snr_db)
        middle = self.instrument.slant_range(self.x, instrument.middle(self.scene)[1])
        return part.snr_db - 40 * np.log10(self.instrument.slant_range(self.x, y) / middle)

    def coherence(self, y: ArrayLike, position_errors: ArrayLike = 0.0) -> Floats:
        """Return the coherence that baseline, noise and position errors leave.

        White position errors that give the echoes phases of variance v leave ``exp(-v)`` of a
        target's power in focus and spread the rest evenly over all paths' growths from position to
        position, which a wavelength of growth repeats. The scene fills the share w of it, with
        targets of other phases: ``s / (s + (1 - s) w)`` is left, with ``s = exp(-v)``.

        Parameters
        ----------
        y
            Distance ahead, m.
        position_errors
            Standard deviation of the echoes' phase at each position and channel, rad.

        Returns
        -------
        ndarray
            Coherence.
        """
        part = self.scene
        focused = np.exp(-(np.asarray(position_errors, float) ** 2))
        filled = np.minimum(1, self.instrument.filled(part.x_min_m, part.x_max_m, y))
        return np.asarray(
            self.instrument.geometric_coherence(self.x, y)
            * speckle.noise_coherence(self.snr_db(y))
            * focused
            / (focused + (1 - focused) * filled)
        )

    def looks(self, y: ArrayLike) -> Floats:
        """Return the independent looks in the coherence window, at least 1."""
        side = self.study.interferogram.coherence_window_px * self.study.imaging.grid_spacing_m
        return self.instrument.looks(side, self.x, y)

    def height_std(self, y: ArrayLike, position_errors: ArrayLike = 0.0) -> Floats:
        """Return the predicted standard deviation of the height on visible ground, m.

        The Cramer-Rao bound of the phase for the looks of the coherence window, and no more than a
        random phase makes (`speckle.phase_std`). The phase filter averages over more than the
        window, and speckle has tails: as long as the phase unwraps, the prediction is good within a
        factor of 2.5, high rather than low where noise decides.

        Parameters
        ----------
        y
            Distance ahead, m.
        position_errors
            As in `coherence`.

        Returns
        -------
        ndarray
            Standard deviation, m.
        """
        phase = speckle.phase_std(self.coherence(y, position_errors), self.looks(y))
        per_radian = self.instrument.height_of_ambiguity(self.x, y) / (2 * np.pi)
        return np.minimum(per_radian * phase, self.instrument.random_phase_std(self.x, y))

    def scene_height_std(self, axis: int = 0, position_std_m: float = 0.0) -> float:
        """Return the predicted height noise over the image: the root of its mean square, m.

        Parameters
        ----------
        axis
            Axis of white position errors.
        position_std_m
            Their standard deviation, m.
        """
        part = self.study.imaging
        x, y = np.linspace(part.x_min_m, part.x_max_m, 5)[:, None], self.places
        errors = position_std_m * self.phase_per_position(x, y, axis)
        return float(np.sqrt(np.mean(self.height_std(y, errors) ** 2)))

    def shadow_length(self, y: ArrayLike) -> Floats:
        """Return how far an obstacle as high as the scene's relief hides the ground behind it, m.

        Infinite where it is as high as the lowest antenna.
        """
        height, lowest = self.relief, self.instrument.lowest
        if height >= lowest:
            return np.full(np.shape(y), np.inf)
        return np.asarray(y, float) * height / (lowest - height)

    def registration_shift(self, y: ArrayLike) -> Floats:
        """Return by how much the images of a target as high as the relief differ in y, m."""
        height = self.relief
        lower, upper = (
            aperture.image_position(part, self.x, y, height)[1]
            for part in (self.instrument.lower, self.instrument.upper)
        )
        return np.abs(lower - upper)

    def height_per_offset(self, x: ArrayLike, y: ArrayLike, direction: Floats) -> Floats:
        """Return the height error per offset of the upper antenna against the lower, m/m.

        The inversion is told that it stands farther along a direction than it does. Where the
        channels share their receivers or their transmitter, the other end alone has the offset.

        Parameters
        ----------
        x, y
            Targets on the ground plane, m, of shapes that broadcast.
        direction
            Direction of the offset (axis,), per unit of it.

        Returns
        -------
        ndarray
            Height error, m per unit.
        """
        x, y = np.broadcast_arrays(np.asarray(x, float), np.asarray(y, float))
        target = np.stack([x, y, np.zeros(x.shape)], axis=-1)
        lower, upper = self.instrument.lower, self.instrument.upper
        path = np.zeros(x.shape)
        for mine, other in (
            (upper.transmitter, lower.transmitter),
            (upper.receiver, lower.receiver),
        ):
            if np.abs(mine - other).max() > _SAME_M:
                line = target - mine
                path -= line @ direction / np.linalg.norm(line, axis=-1)
        # The difference as told, lower less upper, has to stay as it was measured.
        return self.instrument.height_per_difference(x, y) * path

    def _reference(self) -> tuple[Floats, Floats]:
        """Return points that fix the phase constant: corners of level ground, or control points."""
        part = self.study.height
        if part.reference == "level_ground":
            points = [
                (x, y)
                for r in part.level_ground
                for x in (r.x_min_m, r.x_max_m)
                for y in (r.y_min_m, r.y_max_m)
            ]
        else:
            points = [(point.x_m, point.y_m) for point in part.control_points]
        x, y = np.array(points).T
        return x, y

    def offsets(self) -> list[Tolerance]:
        """Return what constant errors of the upper antenna against the lower do to heights.

        Returns
        -------
        list of Tolerance
            Length and attitude of the baseline (Eqs. 5 and 12), and offsets along the axes.
        """
        lower, upper = self.instrument.separated
        along = (upper - lower) / self.instrument.baseline
        # In the plane across the aperture, upwards from horizontal.
        turned = np.array([0.0, -along[2], along[1]]) * self.instrument.baseline
        degree = np.pi / 180
        cases: Mapping[str, tuple[str, float, Floats]] = {
            "length of the baseline (Eq. 5)": ("mm", 1e-3, along),
            "attitude of the baseline (Eq. 12)": ("deg", degree, turned),
            **{
                f"upper antenna along {name}": ("mm", 1e-3, np.eye(3)[axis])
                for axis, name in enumerate(AXES)
            },
        }
        return [self._tolerance(name, *case) for name, case in cases.items()]

    def _tolerance(self, name: str, unit: str, size: float, direction: Floats) -> Tolerance:
        part = self.study.imaging
        x, y = np.meshgrid(
            np.linspace(part.x_min_m, part.x_max_m, 5), np.linspace(part.y_min_m, part.y_max_m, 7)
        )
        error = size * self.height_per_offset(x, y, direction)
        points = self._reference()
        per_difference = self.instrument.height_per_difference
        constant = np.median(
            size * self.height_per_offset(*points, direction) / per_difference(*points)
        )
        referenced = error - constant * per_difference(x, y)
        most = self.study.accuracy.tolerance_m
        return Tolerance(
            name,
            unit,
            size * self.height_per_offset(self.x, self.places, direction),
            most / max(float(np.abs(error).max()), 1e-300),
            most / max(float(np.abs(referenced).max()), 1e-300),
        )

    def phase_per_position(self, x: ArrayLike, y: ArrayLike, axis: int) -> Floats:
        """Return the echo's phase by an error of one antenna position along an axis, rad/m.

        Only ends that move along the aperture have a position anew for each echo.
        """
        x, y = np.broadcast_arrays(np.asarray(x, float), np.asarray(y, float))
        target = np.stack([x, y, np.zeros(x.shape)], axis=-1)
        lower = self.instrument.lower
        slope = np.zeros(x.shape)
        for end, travel in (
            (lower.transmitter, lower.transmitter_travel),
            (lower.receiver, lower.receiver_travel),
        ):
            if travel.any():
                line = target - end
                slope += line[..., axis] / np.linalg.norm(line, axis=-1)
        return 2 * np.pi / self.instrument.wavelength * np.abs(slope)

    def tolerated_scatter(self, axis: int) -> float:
        """Return which white position errors keep 95 % of the heights within the tolerance, m.

        Standard deviation along an axis, drawn anew at each position and for each channel; errors
        that both channels share do as much harm where the relief exceeds the height of ambiguity,
        and none on level ground. At the worst of the image's rows, and of its middle and edges.

        Returns
        -------
        float
            Standard deviation, m; 0 if noise alone exceeds the tolerance, infinite if no error
            matters.
        """
        from scipy.optimize import brentq

        part = self.study.imaging
        x = np.array([part.x_min_m, self.x, part.x_max_m])
        slope = self.phase_per_position(x[:, None], self.places, axis).max(axis=0)
        most = self.study.accuracy.tolerance_m / OF_95_PERCENT

        def excess(std: float) -> float:
            return float(self.height_std(self.places, std * slope).max()) - most

        if excess(0.0) > 0:
            return 0.0
        largest = self.instrument.wavelength
        return float(brentq(excess, 0.0, largest)) if excess(largest) > 0 else math.inf

    def coupling_db(self) -> float | None:
        """Return the coupling's strongest sidelobes in the image over the scene, dB.

        By the envelope of a rectangular window's sidelobes, ``1 / (N sin(pi r / R))`` for N
        frequencies and the unambiguous range R; None where there is no coupling, or something is
        done about it.
        """
        level = self.study.echo.coupling_db
        if (
            level is None
            or self.study.suppression.method != "none"
            or self.study.imaging.range_window != "rectangular"
        ):
            return None
        nearest = float(self.instrument.slant_range(self.x, self.places[0]))
        ends = np.array([nearest, self.farthest_range])
        period, count = self.instrument.unambiguous_range, self.instrument.frequency.size
        turn = np.pi * (ends - self.study.echo.coupling_path_m / 2) / period
        return level - 20 * math.log10(count * float(np.abs(np.sin(turn)).min()))

    def warnings(self) -> list[str]:
        """Return what is unwise, a sentence each, in the order of the chain.

        The whole configuration is read (`validation.advice`).
        """
        found = validation.advice(self.study)
        y, planned = self.places, self.instrument
        if self.farthest_range > _RANGE_SHARE * planned.unambiguous_range:
            found.append(
                f"radar.frequency_count = {planned.frequency.size}: the farthest slant range, "
                f"{self.farthest_range:.2f} m, is nearly the unambiguous range, "
                f"{planned.unambiguous_range:.2f} m: what lies behind the scene folds into it"
            )
        widths = np.array([planned.unambiguous_width(self.x, float(at)) for at in y])
        width = self.scene.x_max_m - self.scene.x_min_m
        if width > _WIDTH_SHARE * widths.min():
            found.append(
                f"radar.position_spacing_m = {self.study.radar.position_spacing_m}: the scene is "
                f"{width:g} m wide and {widths.min():.2f} m are imaged once: what lies beside it "
                "folds into it"
            )
        cell = float(planned.resolution(self.x, y).min())
        if self.study.imaging.grid_spacing_m > cell / 2:
            found.append(
                f"imaging.grid_spacing_m = {self.study.imaging.grid_spacing_m}: above half the "
                f"resolution, {cell / 2:.3f} m: the interferogram is undersampled"
            )
        sidelobes = self.coupling_db()
        if sidelobes is not None and sidelobes > _SIDELOBES_DB:
            found.append(
                f"echo.coupling_db = {self.study.echo.coupling_db}: its sidelobes are "
                f"{sidelobes:+.0f} dB against the scene in the image; take a "
                "suppression.method or an imaging.range_window"
            )
        std, most = self.height_std(y), self.study.accuracy.tolerance_m / OF_95_PERCENT
        if std.max() > most:
            found.append(
                f"accuracy.tolerance_m = {self.study.accuracy.tolerance_m}: the predicted noise of "
                f"{100 * std.max():.1f} cm leaves fewer than 95 % of the heights within it"
            )
        share = float((self.registration_shift(y) / planned.resolution(self.x, y)[1]).max())
        if share > _REGISTRATION_SHARE:
            found.append(
                f"scene: the images of a target as high as the relief, {self.relief:g} m, "
                f"differ by {share:.2f} of a resolution cell, more than a tenth"
            )
        cycle, relief = float(planned.height_of_ambiguity(self.x, y).min()), self.relief
        if relief > 2 * cycle:
            found.append(
                f"radar.baseline_m = {self.study.radar.baseline_m}: the height of ambiguity, "
                f"{cycle:.2f} m, is less than half the relief of {relief:g} m: steps of half of it "
                "unwrap wrongly"
            )
        if np.isinf(self.shadow_length(y)).any():
            found.append(
                f"radar.rail_height_m = {self.study.radar.rail_height_m}: an obstacle as high as "
                "the relief hides all that lies behind it"
            )
        return found


def _span(values: ArrayLike, form: str) -> list[str]:
    return [
        # Without the sign of a negative number that rounds to zero.
        "unlimited" if math.isinf(value) else format(value, "z" + form)
        for value in np.ravel(np.asarray(values, float))
    ]


def as_markdown(sheet: Sheet) -> str:
    """Return a design sheet as Markdown that a terminal shows as well.

    Parameters
    ----------
    sheet
        The predictions, of a whole study.

    Returns
    -------
    str
        Tables of what is predicted, and the warnings.
    """
    study, y = sheet.study, sheet.places
    part, planned = study.radar, sheet.instrument
    place = sheet.x, y
    megabytes = sheet.samples * _BYTES_PER_SAMPLE / 1e6
    lines = [
        f"# Design of the study {study.study}",
        "",
        f"- {part.system}, {part.start_frequency_hz / 1e9:g} to {part.stop_frequency_hz / 1e9:g} "
        f"GHz in {planned.frequency.size} steps, {planned.positions} positions over "
        f"{part.aperture_length_m:g} m, baseline of {part.baseline_m:g} m at "
        f"{part.baseline_angle_deg:g} deg",
        f"- wavelength {1e3 * planned.wavelength:.2f} mm, slant-range resolution "
        f"{1e2 * planned.range_resolution:.2f} cm",
        f"- unambiguous range {planned.unambiguous_range:.2f} m; the farthest target is at "
        f"{sheet.farthest_range:.2f} m",
        f"- {sheet.samples} complex samples a scan of {sheet.scan_duration:.3g} s, "
        f"{megabytes:.2f} MB in single precision; the vehicle drives "
        f"{study.vehicle.forward_speed_m_per_s * sheet.scan_duration:.2f} m in it",
        "",
        f"At x = {sheet.x:g} m, for relief and obstacles of {sheet.relief:g} m:",
        "",
    ]
    resolution, critical = planned.resolution(*place), planned.critical_baseline(*place)
    rows: list[tuple[str, Any, str]] = [
        ("distance ahead y (m)", y, ".2f"),
        ("slant range (m)", planned.slant_range(*place), ".2f"),
        ("look angle from nadir (deg)", np.rad2deg(planned.look_angle(*place)), ".2f"),
        ("resolution in y (cm)", 100 * resolution[1], ".2f"),
        ("resolution in x (cm)", 100 * resolution[0], ".2f"),
        (
            "width imaged without grating lobes (m)",
            [planned.unambiguous_width(sheet.x, float(at)) for at in y],
            ".2f",
        ),
        ("critical baseline of this attitude (m)", critical, ".2f"),
        ("a quarter of it (m)", critical / 4, ".2f"),
        ("height of ambiguity (m)", planned.height_of_ambiguity(*place), ".3f"),
        ("coherence of level ground", sheet.coherence(y), ".3f"),
        ("looks of the coherence window", sheet.looks(y), ".1f"),
        ("predicted height noise, 1 sigma (cm)", 100 * sheet.height_std(y), ".2f"),
        ("registration error, raised target (mm)", 1e3 * sheet.registration_shift(y), ".2f"),
        ("shadow behind an obstacle (m)", sheet.shadow_length(y), ".2f"),
    ]
    table = [(name, *_span(values, form)) for name, values, form in rows]
    lines.append(tables.write(("", "near", "middle", "far"), table, "lrrr"))
    most = 100 * study.accuracy.tolerance_m
    lines += [
        "",
        f"Constant errors, and which move no height of the image by more than {most:g} cm, before "
        "and after the height reference takes its phase constant:",
        "",
        tables.write(
            ("error", "unit", "cm a unit: near", "middle", "far", "tolerated", "with reference"),
            [
                (
                    *(error.name, error.unit, *_span(100 * error.per_unit, ".3f")),
                    *(_amount(error.tolerated), _amount(error.tolerated_referenced)),
                )
                for error in sheet.offsets()
            ],
            "llrrrrr",
        ),
        "",
        "Position errors, independent by position and channel, 1 sigma, with which 95 "
        f"% of the heights stay within {most:g} cm (errors that both channels share, as on a "
        "shaking vehicle or of common receivers, do no more harm than that, and none over level "
        "ground):",
        "",
    ]
    scatter = [(name, sheet.tolerated_scatter(axis)) for axis, name in enumerate(AXES)]
    table = [(name, _amount(1e3 * s), _amount(s / planned.wavelength)) for name, s in scatter]
    lines.append(tables.write(("along", "tolerated (mm)", "wavelengths"), table, "lrr"))
    found = sheet.warnings()
    lines += ["", "Warnings:", ""] if found else ["", "No warnings."]
    lines += [f"- {sentence}" for sentence in found]
    return "\n".join(lines) + "\n"


def _amount(value: float) -> str:
    return "any" if math.isinf(value) or value > 1e6 else f"{value:.3g}"
