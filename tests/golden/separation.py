"""Measure how far changes that a comparison must accept are from those that it must reject.

`python tests/golden/separation.py bricks` measures every figure on both, for several scenes drawn with bricks, and
writes build/benchmarks/goldens_bricks.md; `splats` does the same for splats. The limits of
hsplat_cli/compare/strictness.py come from it; docs/benchmarks/goldens.md says how well they separate the two.

Drivers that a machine has beside its own are named with what makes a program load them:

    --driver "another Mesa: LD_LIBRARY_PATH=... LIBGL_DRIVERS_PATH=... __EGL_VENDOR_LIBRARY_FILENAMES=..."
"""

from __future__ import annotations

import argparse
import shlex
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

FOLDER = Path(__file__).resolve().parent
ROOT = FOLDER.parents[1]
sys.path[:0] = [str(ROOT), str(FOLDER), str(ROOT / "tests" / "support")]

from defects import DEFECTS  # noqa: E402
from harmless import BRICK_MACHINES, HARMLESS, SPLAT_MACHINES, Machine  # noqa: E402
from measured import Measured, measured, on_machine  # noqa: E402
from subjects import BRICKS, SPLATS, Shot, Subject  # noqa: E402

from hsplat_cli.compare import COMPARISON_METRICS, STRICTNESSES  # noqa: E402
from renderer.draw import BrickRasterizer, SplatRasterizer  # noqa: E402
from renderer.system import commit  # noqa: E402

SAME, CROSS = "same-machine", "cross-driver"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("primitive", choices=PARTS)
    parser.add_argument("--driver", action="append", default=[], type=_driver, metavar="NAME: KEY=VALUE ...")
    arguments = parser.parse_args()
    rows, names = _measure(arguments.primitive, arguments.driver)
    file = ROOT / "build" / "benchmarks" / f"goldens_{arguments.primitive}.md"
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(page(arguments.primitive, rows, names, commit()), encoding="utf-8")


def _measure(primitive: str, drivers: Sequence[Machine]) -> tuple[list[Measured], dict[str, str]]:
    """Measure all changes of all subjects; return them, and the names of devices and drivers by machine."""
    rows: list[Measured] = []
    with SplatRasterizer() as of_splats, BrickRasterizer() as of_bricks:
        names = {"this machine": of_splats.device if primitive == "splats" else of_bricks.device}
        shots = [Shot(subject, of_splats, of_bricks) for subject in PARTS[primitive].subjects]
        for shot in shots:
            for change in (*HARMLESS, *DEFECTS):
                row = measured(shot, change)
                if row is not None:
                    _print(row)
                    rows.append(row)
        for machine in (*PARTS[primitive].machines, *drivers):
            names[machine.name], on_it = on_machine(shots, machine, primitive)
            for row in on_it:
                _print(row)
            rows += on_it
    return rows, names


def _driver(text: str) -> Machine:
    name, _, settings = text.partition(": ")
    pairs = [entry.partition("=") for entry in shlex.split(settings)]
    return Machine(name, CROSS, {key: value for key, _, value in pairs})


def _print(row: Measured) -> None:
    figures = " ".join(f"{name} {value:.4g}" for name, value in row.figures.items())
    print(f"{row.subject}, {row.change}: {figures}", flush=True)


def page(primitive: str, rows: Sequence[Measured], drawn_by: dict[str, str], measured_at: str) -> str:
    """Return all figures of a primitive."""
    return "\n".join(
        [
            *_limits(rows),
            *_harmless(rows, drawn_by),
            *_defects(rows),
            *_unseen(rows),
            f"`python tests/golden/separation.py {primitive}` measured this at commit {measured_at} on "
            f"{drawn_by['this machine']}.",
            "",
        ]
    )


@dataclass(frozen=True)
class Part:
    """The pictures for the figures of one primitive."""

    subjects: Sequence[Subject]
    machines: Sequence[Machine]


def _limits(rows: Sequence[Measured]) -> list[str]:
    """Return, for each figure, the worst change that must pass, the limit, and the defects over it."""
    lines = ["### The limits", ""]
    seen = [row for row in rows if row.is_defect and row.is_seen]
    for level, strictest in ((SAME, ("exact", SAME)), (CROSS, ("exact", SAME, CROSS))):
        harmless = [row for row in rows if row.passes_at in strictest]
        cells = []
        for name, figure in COMPARISON_METRICS.items():
            worst, limit = _worst(name, harmless), STRICTNESSES[level].limits.get(name)
            cells.append([f"`{name}`", _figure(worst, name), f"{worst.change}, {worst.subject}"])
            if limit is None:
                cells[-1] += ["none"] + [""] * 4
                continue
            over = [row for row in seen if name in row.figures and not figure.passes(row.figures[name], limit)]
            least = _least(name, over)
            cells[-1] += [f"{limit:g}", str(len(over)), _figure(least, name), f"{least.change}, {least.subject}"]
            cells[-1] += [str(sum(row.over(level) == [name] for row in seen))]
        found = sum(bool(row.over(level)) for row in seen)
        header = ["figure", "worst that must pass", "which is", "limit", "defects over it", "least of them", "which is"]
        lines += [f"#### {level}", "", f"{found} of {len(seen)} visible defects are found.", ""]
        lines += _table([*header, "found by no other figure"], cells)
    return lines


def _worst(name: str, rows: Sequence[Measured]) -> Measured:
    rows = [row for row in rows if name in row.figures]
    return (min if COMPARISON_METRICS[name].higher_is_better else max)(rows, key=lambda row: row.figures[name])


def _harmless(rows: Sequence[Measured], drawn_by: dict[str, str]) -> list[str]:
    lines = []
    for change, group in _by_change(row for row in rows if not row.is_defect):
        worst = [_figure(_worst(name, group), name) for name in COMPARISON_METRICS]
        passes = [f"{sum(not row.over(level) for row in group)}" for level in STRICTNESSES]
        lines.append([change, drawn_by.get(change, ""), str(len(group)), *worst, *passes])
    header = [
        "change",
        "drawn by",
        "frames",
        *(f"worst `{name}`" for name in COMPARISON_METRICS),
        *(f"pass `{x}`" for x in STRICTNESSES),
    ]
    return ["### What must pass", "", *_table(header, lines)]


def _defects(rows: Sequence[Measured]) -> list[str]:
    lines = []
    for change, group in _by_change(row for row in rows if row.is_defect):
        seen = [row for row in group if row.is_seen]
        faint = [row for row in group if not row.is_seen]
        moved = sorted(row.figures["largest"] for row in group)
        found = [_found(rows, level) for rows in (seen, faint) for level in (SAME, CROSS)]
        least = [_figure(_least(name, seen), name) if seen else "" for name in COMPARISON_METRICS]
        lines.append([change, f"{moved[0]:.3g} to {moved[-1]:.3g}", *found, *least])
    header = ["defect", "moves some pixel by, steps", f"found at `{SAME}`", f"found at `{CROSS}`"]
    header += [
        f"faint ones at `{SAME}`",
        f"faint ones at `{CROSS}`",
        *(f"least `{name}`" for name in COMPARISON_METRICS),
    ]
    return ["### What must not pass", "", *_table(header, lines)]


def _found(rows: Sequence[Measured], level: str) -> str:
    return f"{sum(bool(row.over(level)) for row in rows)} of {len(rows)}" if rows else ""


def _least(name: str, rows: Sequence[Measured]) -> Measured:
    rows = [row for row in rows if name in row.figures]
    return (max if COMPARISON_METRICS[name].higher_is_better else min)(rows, key=lambda row: row.figures[name])


def _unseen(rows: Sequence[Measured]) -> list[str]:
    """Return the defects that each level accepts, faint ones included."""
    lines = []
    defects = [row for row in rows if row.is_defect]
    for level in (SAME, CROSS):
        unseen = sorted((row for row in defects if not row.over(level)), key=lambda row: not row.is_seen)
        num_seen = sum(row.is_seen for row in unseen)
        num_faint = len(unseen) - num_seen
        what = f"{num_seen} visible defects and, after them, {num_faint} faint ones, of {len(defects)} in all."
        table = _table(["defect", "frame", *_FIGURE_HEADERS], map(_all_figures, unseen))
        lines += [f"### What `{level}` cannot see", "", what, "", *table]
    return lines


_FIGURE_HEADERS = [*(f"`{name}`" for name in COMPARISON_METRICS), "signed mean of each channel"]


def _all_figures(row: Measured) -> list[str]:
    figures = [_figure(row, name) for name in COMPARISON_METRICS]
    return [row.change, row.subject, *figures, " ".join(f"{mean:+.2g}" for mean in row.bias)]


def _by_change(rows: Iterable[Measured]) -> list[tuple[str, list[Measured]]]:
    groups: dict[str, list[Measured]] = {}
    for row in rows:
        groups.setdefault(row.change, []).append(row)
    return list(groups.items())


def _table(header: Sequence[str], lines: Iterable[Sequence[str]]) -> list[str]:
    return [*(f"| {' | '.join(cells)} |" for cells in (header, ["---"] * len(header), *lines)), ""]


def _figure(row: Measured, name: str) -> str:
    """Return a figure as text, empty where the picture is too small for it."""
    if name not in row.figures:
        return ""
    value = row.figures[name]
    return f"{value:.5f}" if COMPARISON_METRICS[name].higher_is_better and value < 1 else f"{value:.3g}"


PARTS = {"bricks": Part(BRICKS, BRICK_MACHINES), "splats": Part(SPLATS, SPLAT_MACHINES)}


if __name__ == "__main__":
    main()
