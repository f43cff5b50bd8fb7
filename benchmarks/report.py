"""The table, the JSON and the plots."""

from __future__ import annotations

import numpy as np

BUSY = 0.5
"""Load at the start, above which rates are not for the documents."""


def number(value):
    """Return a rate in three digits."""
    return f"{value:.0f}" if value >= 100 else f"{value:.3g}"


def table(result):
    """Return the figures as Markdown."""
    lines = []
    where = result["machine"]
    lines += [
        f"{where['date']}: {where['processor']} ({where['microarchitecture']}"
        f"{', AVX-512' if where['avx512'] else ', without AVX-512'}), {where['cores']} cores, load "
        f"{where['load']:.1f} at the start; Python {where['python']}, "
        + ", ".join(f"{name} {version}" for name, version in where["versions"].items())
        + ".",
    ]
    if where["load"] > BUSY:
        lines.append(
            f"**The machine was busy: its load was {where['load']:.1f} at the start. Ratios of one "
            "run hold, rates do not.**"
        )
    lines += [
        "",
        "| kernel | contender | rate per core | quartiles | by the wall clock | error |",
        "|---|---|---|---|---|---|",
    ]
    kernels = result["kernels"]
    for kernel, part in kernels.items():
        for row in part["rows"]:
            low, high = (row["rate"] * row["median_s"] / s for s in row["quartiles_s"][::-1])
            error = f"{row['error_db']:.1f} dB" if row["error_db"] is not None else ""
            if "agreement" in part and row["contender"].startswith("vinsar"):
                error = f"{100 * part['agreement']:.3f} % like the march"
            lines.append(
                f"| {kernel} | {row['contender']} | {number(row['rate'])} {row['unit']} | "
                f"{number(low)} .. {number(high)} | {number(row['wall_rate'])} | {error} |"
            )
    lines += ["", "| kernel | ours | against | goal | reached |", "|---|---|---|---|---|"]
    for kernel, part in kernels.items():
        for ratio in part["ratios"]:
            lines.append(
                f"| {kernel} | {ratio['ours']} | {ratio['against']} | {ratio['goal']:g} x | "
                f"{ratio['ratio']:.1f} x |"
            )
    for row in result.get("frames", []):
        goal = (
            "60 frames/s" if row["workers"] == 2 and row["chain"].startswith("echo to DEM") else ""
        )
        reached = f"{row['frames_per_s']:.1f} frames/s, {1000 * row['core_seconds']:.0f} ms each"
        lines.append(
            f"| chain at 5 cm: {row['chain']} | {row['workers']} frame(s) at once | "
            f"real time | {goal} | {reached} |"
        )
    if "sweep" in result:
        lines += [
            "",
            f"Cases of the vibration sweep, {result['sweep'][0]['cases']} of them:",
            "",
            "| workers | cases/s | to one |",
            "|---|---|---|",
        ]
        lines += [
            f"| {row['workers']} {row['kind']} | {row['cases_per_s']:.1f} | {row['to_one']:.2f} |"
            for row in result["sweep"]
        ]
    for title, key in (
        ("Stages of the paper's study, a core's time", "stages"),
        ("The same on the grid of 5 cm", "stages_coarse"),
    ):
        if key not in result:
            continue
        lines += ["", f"{title}:", "", "| stage | ms | share |", "|---|---|---|"]
        for row in result[key]:
            ms, share = 1000 * row["seconds"], 100 * row["share"]
            lines.append(f"| {row['stage']} | {ms:.1f} | {share:.0f} % |")
    if "scaling" in result:
        lines += [
            "",
            "| against | computed | sizes | seconds | peak MB | slope of time | of memory |",
            "|---|---|---|---|---|---|---|",
        ]
        for axis, part in result["scaling"].items():
            points = part["points"]
            lines.append(
                f"| {axis} | {part['kind']} | {points[0]['size']} .. {points[-1]['size']} | "
                f"{points[0]['seconds']:.3g} .. {points[-1]['seconds']:.3g} | "
                f"{points[0]['peak_mb']:.0f} .. {points[-1]['peak_mb']:.0f} | "
                f"{part['slope_time']:.2f} | {part['slope_memory']:.2f} |"
            )
        large = result["large"]
        lines += [
            "",
            f"{large['what']}, one core: {large['seconds']:.1f} s, {large['peak_mb']:.0f} MB.",
            "",
            "| stage | seconds | peak MB |",
            "|---|---|---|",
        ]
        lines += [
            f"| {row['stage']} | {row['seconds']:.2f} | {row['peak_mb']:.0f} |"
            for row in large["stages"]
        ]
    return "\n".join(lines) + "\n"


def plot_kernels(result, path):
    """Plot speed against error."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 4.5), layout="constrained")
    for axes, kernel in zip(figure.subplots(1, 2), ("back-projection", "echo"), strict=True):
        rows = [row for row in result["kernels"][kernel]["rows"] if row["error_db"] is not None]
        for row in rows:
            ours = row["contender"].startswith("vinsar")
            label = f"{row['contender']}: {number(row['rate'])}"
            axes.plot(row["error_db"], row["rate"], "o" if ours else "s", label=label)
        axes.set(
            xlabel="error, dB", ylabel=f"{rows[0]['unit']}, one core", yscale="log", title=kernel
        )
        axes.legend(fontsize=7, loc="upper left", bbox_to_anchor=(0, -0.15), ncols=2)
        axes.margins(x=0.1, y=0.15)
    figure.savefig(path, dpi=150, metadata={"Software": None})


def plot_scaling(result, path):
    """Plot time and memory against the sizes, with slopes."""
    from matplotlib.figure import Figure
    from matplotlib.ticker import LogLocator, NullFormatter

    figure = Figure(figsize=(11, 5), layout="constrained")
    grid = figure.subplots(2, len(result["scaling"]))
    for (axis, part), (upper, lower) in zip(result["scaling"].items(), grid.T, strict=True):
        sizes = [point["size"] for point in part["points"]]
        for axes, key, slope, label in (
            (upper, "seconds", part["slope_time"], "time, s"),
            (lower, "peak_mb", part["slope_memory"], "peak memory beyond the inputs, MB"),
        ):
            values = np.array([point[key] for point in part["points"]])
            axes.loglog(sizes, values, "o-", label=f"slope {slope:.2f}")
            # Decades around the values, so that slopes look alike everywhere.
            middle = np.exp(np.log(values).mean())
            axes.set(xlabel=axis, ylim=(middle / 20, middle * 20))
            axes.xaxis.set_major_locator(LogLocator(numticks=4))
            axes.xaxis.set_minor_formatter(NullFormatter())
            axes.yaxis.set_minor_formatter(NullFormatter())
            axes.legend(fontsize=7)
            if axis == next(iter(result["scaling"])):
                axes.set_ylabel(label)
        upper.set_title(f"{part['kind']} against {axis}", fontsize=8)
    figure.savefig(path, dpi=120, metadata={"Software": None})
