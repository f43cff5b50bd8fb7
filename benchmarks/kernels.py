"""The kernels against their contenders: the same data, in turns, error beside speed."""

from __future__ import annotations

import numpy as np

from benchmarks import contenders
from benchmarks.timing import interleaved, summary
from vinsar.foundations import blocks, variables
from vinsar.foundations.constants import SPEED_OF_LIGHT
from vinsar.processing import focusing
from vinsar.radar import trajectory, waveform
from vinsar.simulation import echo, scene, visibility

FREQUENCY = waveform.frequencies(13e9, 15e9, 401)
RAIL = trajectory.rail(
    aperture_length_m=0.8,
    position_spacing_m=0.01,
    rail_height_m=2.0,
    baseline_m=0.3,
    baseline_angle_deg=90.0,
)
LOWER = RAIL.isel(channel=[0])
ANTENNAS = LOWER["transmitter"].values[0]


def error_db(found, exact):
    """Return the error's norm over the exact values', in dB."""
    return float(20 * np.log10(np.linalg.norm(found - exact) / np.linalg.norm(exact)))


def facets(count, seed=0):
    """Return facets at random places of the paper's scene, in rows as the study has them."""
    rng = np.random.default_rng(seed)
    place = rng.uniform([-2.5, 10.0, 0.0], [2.5, 16.0, 0.3], (count, 3))
    place = place[np.lexsort((place[:, 0], place[:, 1] // 0.03))]
    return variables.dataset("facets", {"facet_position": place, "reflectivity": rng.random(count)})


def rows(times, work, errors, goals, unit):
    """Return the table's rows: rate, error and ratios."""
    result = []
    taken, walls = times
    for name, seconds in taken.items():
        row = {"contender": name, "rate": work / np.median(seconds), "unit": unit}
        row["wall_rate"] = work / np.median(walls[name])
        row["error_db"] = errors.get(name)
        row |= summary(seconds)
        result.append(row)
    ratios = []
    for ours, other, goal in goals:
        if ours in taken and other in taken:
            # Round by round, so that a slow spell of the machine meets both.
            ratio = np.median(np.array(taken[other]) / np.array(taken[ours]))
            ratios.append({"ours": ours, "against": other, "ratio": float(ratio), "goal": goal})
    return {"rows": result, "ratios": ratios}


def backprojection(rounds, size=512, pixel=0.01):
    """Measure back-projection of 81 positions, each contender from the echo unless it says so."""
    signal = echo.simulate(facets(3000), LOWER, frequency=FREQUENCY)
    samples = signal["echo"].values[0]
    x = (np.arange(size) - size / 2) * pixel
    y = 12.56 + (np.arange(size) - size / 2) * pixel
    near, far = trajectory.range_extent(LOWER, x, y)

    def profiles(oversampling, interpolation):
        return focusing.compress(
            signal,
            near_range_m=near - 0.1,
            far_range_m=far + 0.1,
            oversampling=oversampling,
            interpolation=interpolation,
        )

    # Two nanometres are nothing to the image, but keep it from being taken for an even rail.
    uneven = LOWER.copy(deep=True)
    uneven["transmitter"].values[:, 40] += 2e-9

    relief = 0.1 * np.sin(2 * x) * np.cos(2 * y)[:, None]

    def ours(oversampling, interpolation, antennas=LOWER, z=0.0):
        made = profiles(oversampling, interpolation)
        return focusing.backproject(made, antennas, x=x, y=y, z=z)["image"].values[0]

    given = profiles(16, "linear")
    slant = given["slant_range"].values
    plain = (
        given["profile"].values[0] / len(ANTENNAS),
        slant[0],
        (slant[-1] - slant[0]) / (slant.size - 1),
        2 * waveform.carrier(FREQUENCY) / SPEED_OF_LIGHT,
        ANTENNAS,
        x,
        y,
    )
    image = np.empty((size, size), np.complex64)

    def naive():
        contenders.numba_backprojection(*plain, image)
        return image

    runs = {
        "vinsar linear 16x": lambda: ours(16, "linear"),
        "vinsar cubic 6x": lambda: ours(6, "cubic"),
        "vinsar cubic 8x": lambda: ours(8, "cubic"),
        "vinsar linear 16x, any positions": lambda: ours(16, "linear", uneven),
        "vinsar cubic 6x, any positions": lambda: ours(6, "cubic", uneven),
        "vinsar linear 16x, on a surface": lambda: ours(16, "linear", z=relief),
        "vinsar cubic 6x, on a surface": lambda: ours(6, "cubic", z=relief),
        "naive numba, profiles given": naive,
        "numpy, profiles given": lambda: contenders.numpy_backprojection(*plain),
    }
    fastsar = contenders.peer("fastsar")
    if fastsar is not None:
        single = np.ascontiguousarray(samples, np.complex64)

        def former(interpolation, oversampling):
            made = fastsar.ExactFormer(
                ANTENNAS,
                FREQUENCY[0],
                FREQUENCY[1] - FREQUENCY[0],
                FREQUENCY.size,
                size,
                size,
                pixel,
                pixel,
                backend="cpu",
                window=False,
                interp=interpolation,
                upsample=oversampling,
                ref=np.zeros(len(ANTENNAS)),
                center=(0.0, 12.56, 0.0),
            )
            return lambda: made(single).T / samples.size

        runs["fastsar linear 16x"] = former("linear", 16)
        runs["fastsar cubic 8x"] = former("cubic", 8)
    some = np.linspace(0, size - 1, 8).astype(int)
    level, raised = (
        contenders.matched_filter(samples, FREQUENCY, ANTENNAS, x, y[some], z)
        for z in (np.zeros_like(relief[some]), relief[some])
    )
    with blocks.serially():
        errors = {
            name: error_db(run()[some], raised if name.endswith("surface") else level)
            for name, run in runs.items()
        }
        taken = interleaved(runs, rounds)
    goals = [
        ("vinsar linear 16x", "fastsar linear 16x", 2.5),
        ("vinsar cubic 6x", "fastsar cubic 8x", 4),
        ("vinsar linear 16x, any positions", "fastsar linear 16x", 1.5),
        ("vinsar cubic 6x, any positions", "fastsar cubic 8x", 2.5),
        ("vinsar linear 16x, on a surface", "vinsar linear 16x, any positions", 0.8),
        ("vinsar cubic 6x, on a surface", "vinsar cubic 6x, any positions", 0.8),
        ("vinsar linear 16x", "naive numba, profiles given", 8),
        ("vinsar linear 16x", "numpy, profiles given", 30),
    ]
    work = size * size * len(ANTENNAS) / 1e6
    return rows(taken, work, errors, goals, "million pixel-positions/s")


def echoes(rounds, count=50_000, positions=27):
    """Measure echoes of facets, all seen, at 401 frequencies."""
    from vinsar.kernels import paths

    finufft = contenders.peer("finufft")

    few = LOWER.isel(position=np.linspace(0, 80, positions).astype(int))
    scatterers = facets(count)
    one = few.isel(position=[0])

    def ours(accuracy_db, antennas=few):
        result = echo.simulate(scatterers, antennas, frequency=FREQUENCY, accuracy_db=accuracy_db)
        return result["echo"].values[0]

    columns = np.ascontiguousarray(scatterers["facet_position"].values.T)
    amplitude = scatterers["reflectivity"].values
    seen = np.ones(count, bool)
    middle, step = FREQUENCY[200] / SPEED_OF_LIGHT, (FREQUENCY[1] - FREQUENCY[0]) / SPEED_OF_LIGHT

    def transform(eps, dtype):
        plan = finufft.Plan(1, (FREQUENCY.size,), eps=eps, isign=-1, nthreads=1, dtype=dtype)
        real = np.float32 if dtype == "complex64" else np.float64
        path, weight, angle = np.empty(count), np.empty(count), np.empty(count)
        strength = np.empty(count, complex)

        def run():
            result = np.empty((positions, FREQUENCY.size), complex)
            for index, antenna in enumerate(few["transmitter"].values[0]):
                paths.gather(columns, amplitude, seen, antenna, antenna, 0.0, path, weight)
                contenders.strengths(path, weight, middle, step, angle, strength)
                plan.setpts(angle.astype(real))
                result[index] = plan.execute(strength.astype(dtype))
            return result

        return run

    runs = {
        "vinsar splat (-85 dB asked)": lambda: ours(-85.0),
        "vinsar splat (-110 dB asked)": lambda: ours(-110.0),
    }
    if finufft is not None:
        for kind, eps, dtype in (
            ("finufft 1e-5 complex64", 1e-5, "complex64"),
            ("finufft 1e-5", 1e-5, "complex128"),
            ("finufft 1.6e-6", 1.6e-6, "complex128"),
        ):
            runs[f"{kind}, our strengths"] = transform(eps, dtype)
    direct = {"direct sum, float64": lambda: ours(None, one)}
    exact = ours(None, few.isel(position=[0, positions // 2]))
    with blocks.serially():
        errors = {name: error_db(run()[[0, positions // 2]], exact) for name, run in runs.items()}
        taken = interleaved(runs | direct, rounds)
    # One position is enough to time it.
    for times in taken:
        times["direct sum, float64"] = [t * positions for t in times["direct sum, float64"]]
    goals = [
        ("vinsar splat (-85 dB asked)", "finufft 1e-5 complex64, our strengths", 4),
        ("vinsar splat (-110 dB asked)", "finufft 1.6e-6, our strengths", 3),
        ("vinsar splat (-110 dB asked)", "direct sum, float64", 100),
    ]
    work = count * positions * FREQUENCY.size / 1e9
    return rows(taken, work, errors, goals, "billion facet-position-frequencies/s")


def boxes(x, y, seed=0):
    """Return level ground with boxes 0.1 to 0.5 m high."""
    rng = np.random.default_rng(seed)
    height = np.zeros((y.size, x.size))
    for _ in range(25):
        left, near = rng.uniform(x[0], x[-1] - 0.5), rng.uniform(y[0], y[-1] - 0.5)
        width, depth = rng.uniform(0.2, 0.6, 2)
        inside = (
            (x[None, :] >= left) & (x[None, :] <= left + width)
            & (y[:, None] >= near) & (y[:, None] <= near + depth)
        )  # fmt: skip
        height[inside] = rng.uniform(0.1, 0.5)
    return height


def sight(rounds):
    """Measure visibility of a raster of 200 x 240 from 162 antennas, on peaks and on boxes."""
    x, y = np.linspace(-2.5, 2.5, 200), np.linspace(10.0, 16.0, 240)
    peaks = scene.terrain(
        "peaks", x_min_m=-2.5, x_max_m=2.5, y_min_m=10.0, y_max_m=16.0, spacing_m=0.01,
        peak_height_m=0.3, reflectivity_offset=0.5,
    )  # fmt: skip
    grid_x, grid_y = np.meshgrid(x, y)
    antennas = RAIL["transmitter"].values.reshape(-1, 3)
    results = {}
    for name, height in (
        ("peaks", scene.sample(peaks["height"], grid_x, grid_y)),
        ("boxes", boxes(x, y)),
    ):
        terrain = variables.dataset(
            "terrain", {"height": height, "reflectivity": height + 1}, {"x": x, "y": y}
        )
        points = np.stack([grid_x, grid_y, height], axis=-1).reshape(-1, 3)
        marched = np.empty((len(antennas), len(points)), bool)

        def march(height=height, points=points, marched=marched):
            for antenna, seen in zip(antennas, marched, strict=True):
                contenders.ray_march(
                    height, x[0], x[1] - x[0], y[0], y[1] - y[0], antenna, points, seen
                )
            return marched

        def fan(terrain=terrain, points=points):
            return visibility.visible_points(terrain, antennas, points)

        with blocks.serially():
            agreement = float((march() == fan()).mean())
            taken = interleaved({"vinsar fan": fan, "ray march, numba": march}, rounds)
        part = rows(
            taken,
            len(antennas) * len(points) / 1e6,
            {},
            [("vinsar fan", "ray march, numba", 60)],
            "million facet-positions/s",
        )
        part["agreement"] = agreement
        part["visible"] = float(marched.mean())
        results[name] = part
    return results
