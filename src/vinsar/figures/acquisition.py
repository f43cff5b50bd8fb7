"""Fig. 1: the geometry of the acquisition, drawn to scale from the configuration."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from vinsar.figures.drawing import declaration, style, thumbnails
from vinsar.radar import formulas, geometry, instrument

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.patches import Rectangle
    from numpy.typing import NDArray

    from vinsar.foundations.configuration import Study
    from vinsar.foundations.stage import Products
    from vinsar.processing.focusing import Imaging
    from vinsar.simulation.scene import Scene
    from vinsar.study.options import Figures

_GROUND, _SCENE, _VEHICLE = "#b8a98f", "#9fc2a2", "#dfe2e5"
_DIMENSION = {
    "arrowstyle": "<->",
    "linewidth": 0.6,
    "shrinkA": 0,
    "shrinkB": 0,
    "mutation_scale": 6,
}
_COMMON: dict[str, Any] = {"color": style.GREY, "linestyle": (0, (5, 1.5))}
_NAMES = {
    "rail": ("$S_1$", "$S_2$", ""),
    "transmit_pair": ("Tx$_1$", "Tx$_2$", "Rx"),
    "receive_pair": ("Rx$_1$", "Rx$_2$", "Tx"),
}
_LEAST_ANGLE_DEG = 25
_EDGES = ("x_min_m", "x_max_m", "y_min_m", "y_max_m")


@dataclass(frozen=True)
class Layout:
    """The antennas and a target seen from the side, and what follows from them.

    Attributes
    ----------
    lower, upper, target
        Positions (y, z) of S1, S2 and T, m.
    baseline, beta
        Length, m, and attitude, rad, of the baseline from S1 to S2.
    names
        What S1 and S2 are called, and the end of the path that both channels have in common.
    common
        Position (y, z) of that end, m; none on a rail.
    aside
        x of S1 and S2, m; the target is at x = 0.
    """

    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    target: NDArray[np.float64]
    baseline: float
    beta: float
    names: tuple[str, str, str]
    common: NDArray[np.float64] | None
    aside: float

    @property
    def ranges(self) -> tuple[float, float]:
        """Slant ranges r1 and r2, m."""
        lower, upper = (
            np.hypot(np.linalg.norm(self.target - s), self.aside) for s in (self.lower, self.upper)
        )
        return float(lower), float(upper)

    @property
    def look(self) -> float:
        """Look angle theta of S1 from nadir, rad."""
        return float(geometry.look_angle((self.aside, *self.lower), 0, *self.target))


def layout(study: Study) -> Layout:
    """Return the geometry of a study, with the target on a top in the middle of its scene.

    Parameters
    ----------
    study
        The configuration.

    Returns
    -------
    Layout
        Positions seen from the side.
    """
    options = study.radar
    beta = np.deg2rad(options.baseline_angle_deg)
    line = np.array([0.0, options.rail_height_m])
    transmitter = np.array([options.transmitter_y_m, options.transmitter_height_m])
    lower, common, aside = {
        "rail": (line, None, 0.0),
        "transmit_pair": (transmitter, line, options.transmitter_x_m),
        "receive_pair": (line, transmitter, 0.0),
    }[options.system]
    step = options.baseline_m * np.array([np.cos(beta), np.sin(beta)])
    middle = (study.scene.y_min_m + study.scene.y_max_m) / 2
    return Layout(
        lower,
        lower + step,
        np.array([middle, study.scene.peak_height_m]),
        options.baseline_m,
        float(beta),
        _NAMES[options.system],
        common,
        aside,
    )


@style.styled
def draw(products: Products, study: Study) -> Figure:
    """Draw Fig. 1.

    Parameters
    ----------
    products
        None are read.
    study
        The configuration.

    Returns
    -------
    matplotlib.figure.Figure
        The figure.
    """
    del products
    scheme = layout(study)
    left, width, below = 11.0, 166.0, 78.0
    view = _side_limits(scheme, study)
    height = width * (view[3] - view[2]) / (view[1] - view[0])
    figure = style.new_figure(style.TWO_COLUMNS_MM, below + 19 + height)
    side = style.place(figure, left, below + 13, width, height)
    _side(side, scheme, study, view)
    _near_antennas(style.place(figure, 13, 10, 66, 66), scheme)
    _values(style.place(figure, 85, 10, 44, 66), study)
    _plan(style.place(figure, 142, 10, 35, 66), scheme, study, 66 / 35)
    return figure


def _side_limits(scheme: Layout, study: Study) -> tuple[float, float, float, float]:
    far = 1.02 * max(study.scene.y_max_m, study.imaging.y_max_m)
    near = min(-1.5 * study.radar.rail_height_m, -0.12 * far, _zoom_limits(scheme)[0])
    # What is written beside the target takes a seventh of the width at its right.
    span = max(far - near, 7 / 6 * (scheme.target[0] - near))
    top = max(1.08 * scheme.target[1], _zoom_limits(scheme)[3])
    return (near, near + span, -0.02 * span, max(top + 0.03 * span, 0.12 * span))


def _side(
    axes: Axes, scheme: Layout, study: Study, view: tuple[float, float, float, float]
) -> None:
    from matplotlib.patches import Arc, Rectangle

    axes.set_xlim(*view[:2])
    axes.set_ylim(*view[2:])
    axes.set_aspect("equal")
    span = view[1] - view[0]
    unit = span / 166  # a millimetre on paper, in metres
    axes.axhspan(view[2], 0, color=_GROUND, linewidth=0)
    scene = (study.scene.y_min_m, study.scene.y_max_m)
    axes.fill_between(scene, view[2], 0, color=_SCENE, linewidth=0)
    axes.text(
        float(np.mean(scene)),
        -0.5 * unit,
        f"scene, {scene[0]:g} … {scene[1]:g} m ahead",
        ha="center",
        va="top",
        fontsize=style.points(6.5),
    )
    rail = study.radar.rail_height_m
    _vehicle(axes, rail)
    target, lower, upper = scheme.target, scheme.lower, scheme.upper
    r1, r2 = scheme.ranges
    if scheme.common is not None:
        axes.plot(*zip(scheme.common, target, strict=True), **_COMMON, linewidth=0.7)
        axes.plot(*scheme.common, "s", color=style.GREY, markersize=3, zorder=5)
    for antenna, colour in ((lower, style.BLUE), (upper, style.ORANGE)):
        axes.plot(*zip(antenna, target, strict=True), color=colour, linewidth=0.8)
        axes.plot(*antenna, "o", color=colour, markersize=3, zorder=5)
    axes.plot(*target, "^", color=style.INK, markersize=5, zorder=5)
    for antenna, text, colour, offset in (
        (lower, f"$r_1$ = {r1:.3f} m", style.BLUE, -1.0),
        (upper, f"$r_2$ = {r2:.3f} m", style.ORANGE, 1.0),
    ):
        step = target - antenna
        at = antenna + 0.55 * step
        axes.text(
            at[0],
            at[1] + offset * unit,
            text,
            color=colour,
            ha="center",
            va="top" if offset < 0 else "bottom",
            rotation=float(np.degrees(np.arctan2(step[1], step[0]))),
            rotation_mode="anchor",
        )
    axes.annotate("", (0, 0), (0, rail), arrowprops=_DIMENSION)
    axes.text(
        -unit,
        0.42 * rail,
        f"$H_0$ = {rail:g} m",
        ha="right",
        va="center",
        fontsize=style.points(7),
    )
    radius = 0.5 * lower[1]
    if radius > 7 * unit:
        diameter, look = 2 * radius, np.degrees(scheme.look)
        axes.add_patch(
            Arc(tuple(lower), diameter, diameter, theta1=-90, theta2=look - 90, linewidth=0.6)
        )
        middle = scheme.look / 3
        at = lower + 0.62 * radius * np.array([np.sin(middle), -np.cos(middle)])
        axes.text(at[0], at[1], r"$\theta$", ha="center", va="center")
    axes.plot([target[0], target[0]], [0, target[1]], color=style.INK, linewidth=0.8)
    axes.annotate(f"T, $h$ = {target[1]:g} m", tuple(target), (5, 2), textcoords="offset points")
    zoom = _zoom_limits(scheme)
    axes.add_patch(
        Rectangle(
            (zoom[0], zoom[2]),
            zoom[1] - zoom[0],
            zoom[3] - zoom[2],
            fill=False,
            edgecolor=style.GREY,
            linewidth=0.6,
            linestyle=":",
        )
    )
    axes.annotate(
        "(b)", (zoom[0], zoom[3]), (0, 1), textcoords="offset points", fontsize=style.points(6.5)
    )
    axes.set_xlabel("y, ahead (m)")
    axes.set_ylabel("z (m)")
    axes.xaxis.set_major_locator(style.round_ticks(11))
    axes.yaxis.set_major_locator(style.round_ticks(4))
    plane = "in the plane x = 0, to scale" if scheme.aside == 0 else "to scale"
    axes.set_title(f"(a) side view {plane} (vehicle schematic)")


def _vehicle(axes: Axes, height: float) -> None:
    """Draw a vehicle of the rail's height; its shape is that of no particular vehicle."""
    from matplotlib.patches import Circle, Polygon

    outline = np.array(
        [(-1.4, 0.2), (-1.4, 0.93), (0.1, 0.93), (0.32, 0.58), (0.72, 0.5), (0.76, 0.2)]
    )
    axes.add_patch(
        Polygon(outline * height, facecolor=_VEHICLE, edgecolor=style.GREY, linewidth=0.6)
    )
    for at in (-1.02, 0.38):
        axes.add_patch(
            Circle((at * height, 0.17 * height), 0.17 * height, facecolor="#70757a", linewidth=0)
        )


def _zoom_limits(scheme: Layout) -> tuple[float, float, float, float]:
    """Return the window around the antennas: a few baselines wide, more of it ahead."""
    middle, half = (scheme.lower + scheme.upper) / 2, 1.05 * scheme.baseline
    if scheme.common is not None:
        places = np.stack([scheme.lower, scheme.upper, scheme.common])
        least, most = places.min(axis=0), places.max(axis=0)
        middle, half = (least + most) / 2, 1.05 * max(scheme.baseline, float(np.max(most - least)))
    return (
        middle[0] - 0.75 * half,
        middle[0] + 1.25 * half,
        middle[1] - half,
        middle[1] + half,
    )


def _near_antennas(axes: Axes, scheme: Layout) -> None:
    from matplotlib.patches import Arc

    view = _zoom_limits(scheme)
    axes.set_xlim(*view[:2])
    axes.set_ylim(*view[2:])
    axes.set_aspect("equal")
    lower, upper, size = scheme.lower, scheme.upper, scheme.baseline
    beta, look = np.degrees(scheme.beta), np.degrees(scheme.look)
    dashed: dict[str, Any] = {"color": style.GREY, "linewidth": 0.6, "linestyle": (0, (4, 3))}
    axes.plot([lower[0], view[1]], [lower[1], lower[1]], **dashed)
    axes.plot([lower[0], lower[0]], [lower[1], view[2]], **dashed)
    axes.plot(*zip(lower, upper, strict=True), color=style.INK, linewidth=1.6, zorder=4)
    for antenna, symbol, colour, side in (
        (lower, "r_1", style.BLUE, -1),
        (upper, "r_2", style.ORANGE, 1),
    ):
        axes.plot(*zip(antenna, scheme.target, strict=True), color=colour)
        axes.plot(*antenna, "o", color=colour, markersize=5, zorder=5)
        # Below the ray of the lower one there may be that of the common end.
        above = side if scheme.common is None else 1
        at_y = view[1] - 0.18 / 2.1 * (view[1] - view[0])
        step = scheme.target - antenna
        at_z = antenna[1] + (at_y - antenna[0]) * step[1] / step[0]
        axes.annotate(
            f"${symbol}$ to T",
            (at_y, at_z),
            (0, 3 * above),
            textcoords="offset points",
            color=colour,
            ha="center",
            va="bottom" if above > 0 else "top",
        )
    if scheme.common is not None:
        axes.plot(*zip(scheme.common, scheme.target, strict=True), **_COMMON)
        axes.plot(*scheme.common, "s", color=style.GREY, markersize=5, zorder=5)
        axes.annotate(
            scheme.names[2],
            tuple(scheme.common),
            (-6, -3),
            textcoords="offset points",
            ha="right",
        )
    first, second, _ = scheme.names
    for antenna, name, offset in ((lower, first, (-6, -3)), (upper, second, (0, 5))):
        axes.annotate(
            name,
            tuple(antenna),
            offset,
            textcoords="offset points",
            ha="right" if offset[0] else "center",
        )
    # Too narrow an angle has no room for an arc and its value.
    narrow = min(beta, 180 - beta) < _LEAST_ANGLE_DEG
    normal = np.array([-np.sin(scheme.beta), np.cos(scheme.beta)])
    axes.annotate(
        f"$B$ = {size:g} m" + (rf", $\beta$ = {beta:g}°" if narrow else ""),
        tuple((lower + upper) / 2),
        tuple(6 * normal),
        textcoords="offset points",
        ha="right" if normal[0] < -0.3 else "center",
        va="center" if normal[0] < -0.3 else "bottom",
    )
    arcs = [(0.30, -90.0, look - 90, rf"$\theta$ = {look:.2f}°")]
    if not narrow:
        arcs.append((0.42, 0.0, beta, rf"$\beta$ = {beta:g}°"))
    for radius, start, stop, text in arcs:
        span = 2 * radius * size
        axes.add_patch(Arc(tuple(lower), span, span, theta1=start, theta2=stop, linewidth=0.8))
        # Beside the arc, to the right even where the angle is obtuse.
        middle = np.deg2rad(start + min(stop - start, 90) / 2)
        axes.annotate(
            text,
            tuple(lower + radius * size * np.array([np.cos(middle), np.sin(middle)])),
            (3 * np.cos(middle), 3 * np.sin(middle)),
            textcoords="offset points",
            va="center",
        )
    axes.set_xlabel("y, ahead (m)")
    axes.set_ylabel("z (m)")
    axes.xaxis.set_major_locator(style.round_ticks(7))
    axes.yaxis.set_major_locator(style.round_ticks(7))
    axes.set_title("(b) the antennas, to scale")


def values(study: Study) -> list[tuple[str, str]]:
    """Return the quantities that Fig. 1 lists, as symbol or name and value.

    Parameters
    ----------
    study
        The configuration.

    Returns
    -------
    list of tuple of str
        The radar; then, after an empty row, what follows for the target T.
    """
    scheme, options = layout(study), study.radar
    planned = instrument.Instrument.planned(options)
    r1, r2 = scheme.ranges
    along, across = formulas.baseline_components(scheme.baseline, scheme.beta, scheme.look)
    # On the ground below the target, straight ahead.
    place = 0.0, scheme.target[0]
    if options.system == "rail":
        antennas = [
            ("aperture $L$", f"{options.aperture_length_m:g} m"),
            ("positions", f"{planned.positions}"),
            ("rail height $H_0$", f"{options.rail_height_m:g} m"),
        ]
    else:
        antennas = [
            ("array $L$", f"{options.aperture_length_m:g} m"),
            ("elements", f"{planned.positions}"),
            ("array height $H_0$", f"{options.rail_height_m:g} m"),
            ("transmitter height", f"{options.transmitter_height_m:g} m"),
        ]
    return [
        (
            "frequency",
            f"{options.start_frequency_hz / 1e9:g} … {options.stop_frequency_hz / 1e9:g} GHz",
        ),
        (r"wavelength $\lambda$", f"{1000 * planned.wavelength:.1f} mm"),
        ("slant-range resolution", f"{100 * planned.range_resolution:.1f} cm"),
        *antennas,
        ("baseline $B$", f"{scheme.baseline:g} m"),
        (r"baseline angle $\beta$", f"{options.baseline_angle_deg:g}°"),
        ("", ""),
        (r"look angle $\theta$", f"{np.degrees(scheme.look):.2f}°"),
        (r"$\Delta r = r_1 - r_2$", _signed(1000 * (r1 - r2), ".1f", "mm")),
        ("$B_∥$", _signed(1000 * float(along), ".1f", "mm")),
        ("$B_⊥$", _signed(1000 * float(across), ".1f", "mm")),
        ("height of ambiguity", f"{float(planned.height_of_ambiguity(*place)):.3f} m"),
        ("resolution in x", f"{100 * float(planned.resolution(*place)[0]):.1f} cm"),
    ]


def _signed(value: float, form: str, unit: str) -> str:
    return f"{value:{form}} {unit}".replace("-", "−")


def _values(axes: Axes, study: Study) -> None:
    rows = values(study)
    axes.set_axis_off()
    axes.set_xlim(0, 1)
    axes.set_ylim(len(rows) + 0.5, -0.5)
    axes.set_title("The radar")
    for row, (name, value) in enumerate(rows):
        if name:
            axes.text(0, row, name, va="center")
            axes.text(1, row, value, va="center", ha="right")
        else:
            axes.text(0, row + 0.2, "At the target T", va="center", fontsize=style.points(8))


def _plan(axes: Axes, scheme: Layout, study: Study, shape: float) -> None:
    """Draw the plan; `shape` is the axes' height over width."""
    from matplotlib.patches import Rectangle

    scene, image = study.scene, study.imaging
    rail = study.radar.rail_height_m
    # The vehicle's hood in the plan, of the proportions of the side view.
    body = (-0.45 * rail, -1.4 * rail, 0.9 * rail, 2.16 * rail)
    near, far = -1.5 * rail, 1.1 * max(scene.y_max_m, image.y_max_m)
    half = max(abs(edge) for area in (scene, image) for edge in (area.x_min_m, area.x_max_m))
    half = 1.1 * max(half, body[2] / 2, study.radar.aperture_length_m / 2)
    half = max(half, (far - near) / shape / 2)
    far = max(far, near + 2 * half * shape)
    axes.set_xlim(-half, half)
    axes.set_ylim(near, far)
    axes.set_aspect("equal")
    axes.add_patch(
        Rectangle(body[:2], *body[2:], facecolor=_VEHICLE, edgecolor=style.GREY, linewidth=0.6)
    )
    axes.add_patch(_area(scene, facecolor=_SCENE, edgecolor="none"))
    same = all(getattr(scene, edge) == getattr(image, edge) for edge in _EDGES)
    axes.annotate(
        "scene and image" if same else "scene, image outlined",
        (0, max(scene.y_max_m, image.y_max_m)),
        (0, 3),
        textcoords="offset points",
        ha="center",
        fontsize=style.points(6.5),
    )
    axes.add_patch(_area(image, fill=False, edgecolor=style.INK, linewidth=0.7))
    end = study.radar.aperture_length_m / 2
    rail_colour, place = style.BLUE, None
    if study.radar.system != "rail":
        place = (study.radar.transmitter_x_m, study.radar.transmitter_y_m)
    if study.radar.system == "transmit_pair":
        rail_colour = style.GREY
    for x in (-end, end):
        axes.plot([x, 0], [0, scheme.target[0]], color=rail_colour, linewidth=0.5)
    axes.plot([-end, end], [0, 0], color=rail_colour, linewidth=2.2, solid_capstyle="butt")
    if place is not None:
        marker, colour = ("o", style.BLUE) if rail_colour == style.GREY else ("s", style.GREY)
        axes.plot([place[0], 0], [place[1], scheme.target[0]], color=colour, linewidth=0.5)
        axes.plot(*place, marker, color=colour, markersize=4, zorder=5)
        axes.annotate("Tx", place, (0, -4), textcoords="offset points", ha="center", va="top")
    axes.plot(0, scheme.target[0], "^", color=style.INK, markersize=5, zorder=5)
    axes.annotate("T", (0, scheme.target[0]), (4, 0), textcoords="offset points", va="center")
    side = -1 if place is not None and place[0] > 0 else 1
    axes.annotate(
        "$L$",
        (side * body[2] / 2, 0),
        (2 * side, 0),
        textcoords="offset points",
        va="center",
        ha="left" if side > 0 else "right",
    )
    axes.xaxis.set_major_locator(style.round_ticks(4))
    axes.yaxis.set_major_locator(style.round_ticks(9))
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y, ahead (m)")
    axes.set_title("(c) plan, to scale")


def _area(area: Scene | Imaging, **look: Any) -> Rectangle:
    from matplotlib.patches import Rectangle

    return Rectangle(
        (area.x_min_m, area.y_min_m),
        area.x_max_m - area.x_min_m,
        area.y_max_m - area.y_min_m,
        **look,
    )


def numbers(products: Products, study: Study) -> str:
    """Return the ranges and angles that Fig. 1 draws, as a sentence."""
    del products
    scheme = layout(study)
    r1, r2 = scheme.ranges
    return (
        f"Drawn for a target {scheme.target[0]:g} m ahead and {scheme.target[1]:g} m high: "
        f"r1 = {r1:.3f} m, r2 = {r2:.3f} m, θ = {np.degrees(scheme.look):.2f}°."
    )


def _positions(axes: Axes, product: xr.Dataset, options: Figures) -> None:
    del options
    for channel, colour in enumerate((style.BLUE, style.ORANGE)):
        for name, marker in (("receiver", "."), ("transmitter", "+")):
            x, _, z = product[name].values[channel].T
            axes.plot(x, z, marker, color=colour, markersize=2.5, markeredgewidth=0.4)
    axes.margins(0.1, 0.6)


def _visible(axes: Axes, product: xr.Dataset, options: Figures) -> None:
    del options
    axes.imshow(
        product["visible"].values[0], cmap="gray", aspect="auto", interpolation="antialiased"
    )


FIGURES = {
    "fig1": declaration.Figure(
        draw=draw,
        title="Geometry",
        caption=(
            "The antennas above the ground plane (S1 and S2 on a rail, Tx and Rx of an array), "
            "drawn to scale from the configuration, with baseline, look angle and slant ranges "
            "to a target in the scene; height of ambiguity and resolution are those on the "
            "ground below the target."
        ),
        sections=("figures", "radar", "scene", "imaging"),
        numbers=numbers,
    ),
}

THUMBNAILS = {
    "trajectory": thumbnails.Thumbnail("antenna positions, x and z", _positions),
    "true_trajectory": thumbnails.Thumbnail("where the antennas really were", _positions),
    "recorded_trajectory": thumbnails.Thumbnail("the positions that focusing uses", _positions),
    "visibility": thumbnails.Thumbnail("facets seen from each position, lower antenna", _visible),
}
