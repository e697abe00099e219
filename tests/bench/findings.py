"""Measure what splats cost: `python tests/bench/findings.py DATA` writes docs/benchmarks/findings.md and its plots.

Measures the engine, the bonsai (both read from the folder DATA) and the test signal of Marschner and Lobb by
`hsplat measure --peer vtk`, and draws the numbers together. `--studies FOLDER` keeps the reports of each study, and
uses those that are there already.
"""

from __future__ import annotations

import argparse
import math
import statistics
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
from kept_study import kept_study

matplotlib.use("agg")
from matplotlib import pyplot

from renderer.study import cost_at_psnr

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "benchmarks" / "findings.md"

FEWEST_POINTS = 4
TRADE = ("--footprints", "gaussian", "--peer", "vtk")
# Subdivisions of the paper's footprint, and the largest cuts that are drawn with them, which take seconds a frame.
MESHES = ("4x1", "6x2", "8x3", "16x6")
MOST_SPLATS_OF_MESHES = 200_000
NUM_TOLERANCES_OF_MESHES = 3


@dataclass(frozen=True)
class Subject:
    """One scene. file: its volume in DATA; None where the scene makes it up."""

    name: str
    title: str
    file: str | None


SUBJECTS = (
    Subject("engine", "Engine, CT, 256 x 256 x 128", "engine.nhdr"),
    Subject("bonsai", "Bonsai, CT, 256 x 256 x 256", "bonsai.nhdr"),
    Subject("marschner_lobb", "Test signal of Marschner and Lobb, 41 x 41 x 41", None),
)


@dataclass(frozen=True)
class Point:
    """One setting over all its frames."""

    tolerance: float
    label: str
    splats: float
    ms: float
    psnr: float
    psnr_on_volume: float
    ssim: float
    flip: float


Series = dict[str, list[Point]]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("data", type=Path)
    parser.add_argument("--studies", type=Path)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        studies = arguments.studies or Path(folder)
        found = [measured(subject, arguments.data, studies / subject.name) for subject in SUBJECTS]
    origins = {origin(study) for pair in found for study in pair}
    assert len(origins) == 1, f"numbers of several commits or machines: {origins}"
    # Nothing is written before all is measured: a changed page would be a changed commit.
    summary: list[tuple[str, ...]] = []
    parts: list[str] = []
    for subject, (trade, meshes) in zip(SUBJECTS, found, strict=True):
        plot(subject, series_of(trade))
        summary.append(in_short(subject, series_of(trade), series_of(meshes)))
        parts += section(subject, trade, series_of(trade), series_of(meshes))
    page = [*heading(found[0][0]), *table(SUMMARY, summary), *parts]
    PAGE.write_text("\n".join(page).rstrip() + "\n", "utf-8")


def measured(subject: Subject, data: Path, studies: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """The trade of Gaussians and of VTK, and the paper's footprint against Gaussians where it is affordable."""
    trade = study_of(subject, data, studies / "trade", TRADE)
    return trade, study_of(subject, data, studies / "meshes", meshes_at(series_of(trade)))


def study_of(subject: Subject, data: Path, folder: Path, options: Sequence[str]) -> dict[str, Any]:
    """The JSON of a study, measured now unless it is there."""
    scene = ROOT / "configs" / f"{subject.name}.yaml"
    return kept_study(scene, data / subject.file if subject.file else None, folder, options)


def origin(study: dict[str, Any]) -> tuple[str, ...]:
    """What must be the same for all numbers of a page."""
    return tuple(study["machine"][name] for name in ("processor", "driver", "commit"))


def meshes_at(trade: Series) -> list[str]:
    """The options of a study of the paper's footprint, at tolerances where it does not take too long."""
    affordable = [p.tolerance for p in trade["gaussian, optical"] if p.splats <= MOST_SPLATS_OF_MESHES]
    tolerances = ",".join(f"{tolerance:g}" for tolerance in affordable[-NUM_TOLERANCES_OF_MESHES:])
    footprints = ",".join(["gaussian", *(f"gouraud:{mesh}" for mesh in MESHES)])
    return ["--footprints", footprints, "--measures", "optical", "--corrections", "on", "--tolerances", tolerances]


def series_of(study: dict[str, Any]) -> Series:
    """The points of each series, from coarse to fine."""
    series: Series = {}
    for each in study["measurements"]:
        everywhere, on_volume = each["overall"]["everywhere"], each["overall"]["on_volume"]
        point = Point(
            tolerance=each["options"].get("tolerance", math.nan),
            label=each["label"],
            splats=each["num_splats"] or math.nan,
            ms=1e3 * each["frame_seconds"]["median"],
            psnr=everywhere["psnr"],
            psnr_on_volume=on_volume["psnr"],
            ssim=everywhere["ssim"],
            flip=everywhere["flip"],
        )
        series.setdefault(each["series"], []).append(point)
    return series


# --------------------------------------------------------------------------------------------------------------- page


def heading(study: dict[str, Any]) -> list[str]:
    machine = study["machine"]
    return [
        "# What splats cost, and what they reach",
        "",
        "Footprint: splats (`gaussian`, and the paper's `gouraud`), which are not the default. Measure again when "
        "error measures, splats, the opacity correction or the drawing of splats change.",
        "",
        "`python tests/bench/findings.py DATA` writes this page with `hsplat measure`. Errors are against the "
        f"converged ray integral, over {len(study['truths'])} frames of each path. Times are medians of warm frames, "
        "from the order of the splats to 8 bits, without the cut and the encoding.",
        "",
        f"Commit {machine['commit']}, {study['date']}; {machine['processor']}, {machine['cores']} cores; "
        f"{machine['driver']}; {machine['system']}.",
        "",
        "The outermost layer of voxels is transparent because VTK's volumes end half a voxel earlier; where the "
        "footprints are compared, it is as scanned. VTK's frames have 8 bits, which alone limits them to about 59 dB.",
        "",
        "In short, of Gaussian splats with the `optical` measure:",
        "",
    ]


def section(subject: Subject, study: dict[str, Any], trade: Series, meshes: Series) -> list[str]:
    own = trade["gaussian, optical"]
    return [
        f"## {subject.title}",
        "",
        f"![PSNR over time and over splats](findings-{subject.name}.png)",
        "",
        *table(
            ("tolerance", "splats", "ms", "PSNR", "on the volume", "SSIM", "FLIP"),
            [
                (
                    f"{p.tolerance:g}",
                    f"{p.splats:.0f}",
                    f"{p.ms:.0f}",
                    db(p.psnr),
                    db(p.psnr_on_volume),
                    f"{p.ssim:.4f}",
                    f"{p.flip:.4f}",
                )
                for p in own
            ],
        ),
        *splats_buy(trade),
        *measures_compared(trade),
        *corrections_compared(trade),
        *meshes_compared(meshes),
        *vtk_compared(trade),
        *(f"- {note}" for note in study["notes"] if "gets worse" in note),
        "",
    ]


SUMMARY = (
    "",
    "best PSNR",
    "best of VTK",
    "ten times the splats",
    "splats for 1 dB below the best",
    "correction gains",
    "gouraud 8x3 against gaussian",
)


def in_short(subject: Subject, trade: Series, meshes: Series) -> tuple[str, ...]:
    """A line of the table at the head of the page, of `optical` where nothing else is said."""
    own = trade["gaussian, optical"]
    psnrs, counts = [p.psnr for p in own], [p.splats for p in own]
    enough = cost_at_psnr(psnrs, counts, max(psnrs) - 1)
    mesh = {p.tolerance: p.psnr for p in meshes["gouraud 8x3, optical"]}
    return (
        subject.title.partition(",")[0],
        db(max(psnrs)),
        db(max(p.psnr for name, points in trade.items() if name.startswith("vtk") for p in points)),
        f"{slope(own):.1f} dB",
        f"{enough:.0f} of {counts[-1]:.0f}",
        f"{statistics.fmean(gains(trade, 'optical')):+.1f} dB",
        f"{statistics.fmean(mesh[p.tolerance] - p.psnr for p in meshes['gaussian, optical']):+.2f} dB",
    )


def gains(trade: Series, measure: str) -> list[float]:
    """What the opacity correction gains in dB, at each tolerance above 0."""
    without = {p.tolerance: p for p in trade[f"gaussian, {measure}, uncorrected"]}
    return [p.psnr - without[p.tolerance].psnr for p in trade[f"gaussian, {measure}"] if p.tolerance > 0]


def slope(points: Sequence[Point]) -> float:
    """What ten times the splats buy in dB; NaN where a few points say nothing of it."""
    told = [(math.log10(p.splats), p.psnr) for p in points if p.splats > 0 and math.isfinite(p.psnr)]
    if len(points) < FEWEST_POINTS or len({splats for splats, _ in told}) < 2:
        return math.nan
    return statistics.linear_regression(*zip(*told, strict=True)).slope


def splats_buy(trade: Series) -> list[str]:
    """How many dB each tenfold of splats buys: the slope of a straight line, and where it flattens."""
    lines = []
    ranges = "over the whole range", "up to 1 dB below the best"
    for name, label in (("gaussian, optical", "optical"), ("gaussian, rms", "rms")):
        points = trade[name]
        best = max(p.psnr for p in points)
        steep = [p for p in points if p.psnr < best - 1]
        slopes = [slope(part) for part in (points, steep)]
        enough = min((p for p in points if p.psnr >= best - 1), key=lambda p: p.splats)
        buys = [f"{value:.1f} dB {where}" for value, where in zip(slopes, ranges, strict=True) if math.isfinite(value)]
        what = f"ten times the splats buy {', '.join(buys)}" if buys else "too few points for a slope"
        part = f"{enough.splats / points[-1].splats:.0%}"
        lines.append(f"- `{label}`: {what}; 1 dB below the best takes {part} of the splats of full resolution.")
    return ["**What splats buy.**", "", *lines, ""]


def measures_compared(trade: Series) -> list[str]:
    """Splats that each error measure takes for the same accuracy."""
    optical, rms = trade["gaussian, optical"], trade["gaussian, rms"]
    rows = []
    for wanted in levels(optical, rms):
        counts = [cost_at_psnr([p.psnr for p in s], [p.splats for p in s], wanted) for s in (optical, rms)]
        rows.append((f"{wanted} dB", *(f"{count:.0f}" for count in counts), f"{counts[1] / counts[0]:.2f}"))
    return [
        "**`rms` against `optical`.** Splats for an accuracy, interpolated between tolerances:",
        "",
        *table(("accuracy", "optical", "rms", "rms / optical"), rows),
    ]


def corrections_compared(trade: Series) -> list[str]:
    """PSNR without the opacity correction, at the same tolerances."""
    rows = []
    for measure in ("optical", "rms"):
        found = gains(trade, measure)
        rows.append((f"`{measure}`", f"{statistics.fmean(found):+.1f} dB", f"{min(found):+.1f}", f"{max(found):+.1f}"))
    return [
        "**With and without opacity correction.** What the correction gains, over all tolerances above 0:",
        "",
        *table(("measure", "mean", "least", "most"), rows),
    ]


def meshes_compared(meshes: Series) -> list[str]:
    """The paper's footprint against the Gaussian one, at the same cuts."""
    gaussian = {p.tolerance: p for p in meshes["gaussian, optical"]}
    rows = []
    for name in (f"gouraud {mesh}" for mesh in MESHES):
        points = meshes[f"{name}, optical"]
        losses = [p.psnr - gaussian[p.tolerance].psnr for p in points]
        times = [p.ms / gaussian[p.tolerance].ms for p in points]
        angular, radial = map(int, name.split()[1].split("x"))
        rows.append(
            (
                name,
                str(angular * (2 * radial - 1)),
                f"{min(losses):+.2f} to {max(losses):+.2f} dB",
                f"{statistics.median(times):.1f}",
            )
        )
    tolerances = ", ".join(f"{tolerance:g}" for tolerance in gaussian)
    return [
        f"**`gouraud` by subdivisions against `gaussian`**, at the tolerances {tolerances}:",
        "",
        *table(("footprint", "triangles", "PSNR against gaussian", "time against gaussian"), rows),
    ]


def vtk_compared(trade: Series) -> list[str]:
    """Milliseconds for an accuracy, on the front of all settings of each program."""
    own = [p for name, points in trade.items() if not name.startswith("vtk") for p in points]
    peers = [p for name, points in trade.items() if name.startswith("vtk") for p in points]
    best = max(p.psnr for p in peers)
    rows = []
    for wanted in range(5 * math.ceil(max(min(p.psnr for p in s) for s in (own, peers)) / 5), math.floor(best) + 1, 5):
        ours, theirs = (cost_at_psnr([p.psnr for p in s], [p.ms for p in s], wanted) for s in (own, peers))
        reached = math.isfinite(ours)
        rows.append(
            (
                f"{wanted} dB",
                f"{ours:.0f}" if reached else "not reached",
                f"{theirs:.0f}",
                f"{ours / theirs:.2f}" if reached else "",
            )
        )
    return [
        f"**Against VTK**, whose best setting comes to {best:.1f} dB; hsplat's to {max(p.psnr for p in own):.1f} dB. "
        "Milliseconds of a frame on the front of all settings, interpolated between them:",
        "",
        *table(("accuracy", "hsplat", "VTK", "hsplat / VTK"), rows),
    ]


def levels(*series: Sequence[Point]) -> Iterator[int]:
    """Accuracies, every 2 dB, that all of the series reach and none exceeds with its coarsest point."""
    low = max(min(p.psnr for p in points) for points in series)
    high = min(max(p.psnr for p in points) for points in series)
    return (level for level in range(math.ceil(low), math.floor(high) + 1) if level % 2 == 0)


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """In Markdown, with an empty line behind."""
    if not rows:
        return ["The series reach no accuracy in common, so nothing is compared.", ""]
    return [f"| {' | '.join(row)} |" for row in (header, ["---"] * len(header), *rows)] + [""]


def db(value: float) -> str:
    return f"{value:.2f} dB"


# --------------------------------------------------------------------------------------------------------------- plot


def plot(subject: Subject, series: Series) -> None:
    """PSNR over time and over splats, one curve for each series."""
    figure, (over_time, over_splats) = pyplot.subplots(1, 2, figsize=(11, 4.2), sharey=True, layout="constrained")
    for name, points in series.items():
        psnrs = [p.psnr for p in points]
        if name.startswith("vtk"):  # two parameters: its points are no curve
            over_time.plot([p.ms for p in points], psnrs, "s", label=name, markersize=4, fillstyle="none")
        else:
            over_time.plot([p.ms for p in points], psnrs, "o-", label=name, markersize=4)
            over_splats.plot([p.splats for p in points], psnrs, "o-", markersize=4)
    for axes, label in ((over_time, "time of a frame, ms"), (over_splats, "splats")):
        axes.set_xscale("log")
        axes.set_xlabel(label)
        axes.grid(alpha=0.3)
    over_time.set_ylabel("PSNR, dB")
    figure.legend(loc="outside lower center", ncols=3, frameon=False)
    figure.savefig(PAGE.with_name(f"findings-{subject.name}.png"), dpi=90, metadata={"Software": None})
    pyplot.close(figure)


if __name__ == "__main__":
    main()
