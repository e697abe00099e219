"""Measure which limits of a comparison find which defects, and at which PSNR of the worst part.

`python tests/golden/separation.py bricks` draws several scenes with every defect and every harmless change, and writes
the tables of docs/benchmarks/goldens.md to build/benchmarks/goldens_bricks.md; `splats` does the same for splats.

Drivers that a machine has beside its own are named with the variables that make a program load them:

    --driver "another Mesa: LD_LIBRARY_PATH=... LIBGL_DRIVERS_PATH=... __EGL_VENDOR_LIBRARY_FILENAMES=..."
"""

from __future__ import annotations

import argparse
import shlex
import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

FOLDER = Path(__file__).resolve().parent
ROOT = FOLDER.parents[1]
sys.path[:0] = [str(ROOT), str(FOLDER), str(ROOT / "tests" / "support")]

from defects import DEFECTS  # noqa: E402
from harmless import BRICK_MACHINES, HARMLESS, SPLAT_MACHINES, Machine  # noqa: E402
from measured import LIMITS, Measured, measured, on_machine  # noqa: E402
from subjects import BRICKS, SPLATS, Shot, Subject  # noqa: E402

from renderer.accuracy import MOST_DB  # noqa: E402
from renderer.draw import BrickRasterizer, SplatRasterizer  # noqa: E402
from renderer.system import commit  # noqa: E402


@dataclass(frozen=True)
class Part:
    """The pictures for the tables of one primitive."""

    subjects: Sequence[Subject]
    machines: Sequence[Machine]


PARTS = {"bricks": Part(BRICKS, BRICK_MACHINES), "splats": Part(SPLATS, SPLAT_MACHINES)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("primitive", choices=PARTS)
    parser.add_argument("--driver", action="append", default=[], type=_driver, metavar="NAME: KEY=VALUE ...")
    arguments = parser.parse_args()
    rows, device = _measure(arguments.primitive, arguments.driver)
    file = ROOT / "build" / "benchmarks" / f"goldens_{arguments.primitive}.md"
    file.parent.mkdir(parents=True, exist_ok=True)
    by = f"`python tests/golden/separation.py {arguments.primitive}`, commit {commit()}, {device}"
    file.write_text("\n".join([*_harmless(rows), "", *_defects(rows), "", *_missed(rows), "", by, ""]), "utf-8")


def _driver(text: str) -> Machine:
    name, _, settings = text.partition(": ")
    pairs = [entry.partition("=") for entry in shlex.split(settings)]
    return Machine(name, "40 dB", {key: value for key, _, value in pairs})


def _measure(primitive: str, drivers: Sequence[Machine]) -> tuple[list[Measured], str]:
    """Measure all changes of all subjects; return them, and the name of the device."""
    rows: list[Measured] = []
    with SplatRasterizer() as of_splats, BrickRasterizer() as of_bricks:
        shots = [Shot(subject, of_splats, of_bricks) for subject in PARTS[primitive].subjects]
        for shot in shots:
            found = (measured(shot, change) for change in (*HARMLESS, *DEFECTS))
            rows += _printed(row for row in found if row is not None)
        for machine in (*PARTS[primitive].machines, *drivers):
            rows += _printed(on_machine(shots, machine, primitive)[1])
        return rows, of_splats.device if primitive == "splats" else of_bricks.device


def _printed(rows: Iterable[Measured]) -> Iterator[Measured]:
    for row in rows:
        figures = row.figures
        states = "{:.1f} and {:.1f} dB".format(*row.stated)
        print(f"{row.subject}, {row.change}: part {figures.part_psnr:.1f} dB, picture {figures.psnr:.1f} dB, "
              f"largest {figures.largest:.0f}, stated {states}", flush=True)  # fmt: skip
        yield row


def _harmless(rows: Sequence[Measured]) -> Iterator[str]:
    """Yield a table of harmless changes: their worst part, and how many pictures pass each limit."""
    lines = []
    for change, group in _by_change(row for row in rows if not row.is_defect):
        passing = [f"{sum(row.passes(limit) for row in group)} of {len(group)}" for limit in LIMITS]
        lines.append([change, _decibels(min(row.figures.part_psnr for row in group)), *passing])
    yield from _table(["passes at", "worst part", *(f"`{limit}`" for limit in LIMITS)], lines)


def _defects(rows: Sequence[Measured]) -> Iterator[str]:
    """Yield a table of defects that can be seen: the PSNR of their worst parts, and how many each limit finds."""
    lines = []
    for change, group in _by_change(row for row in rows if row.is_defect and row.is_seen):
        parts = sorted(row.figures.part_psnr for row in group)
        found = [f"{sum(not row.passes(limit) for row in group)} of {len(group)}" for limit in LIMITS]
        lines.append([change, f"{parts[0]:.0f} to {parts[-1]:.0f} dB", *found])
    seen = [row for row in rows if row.is_defect and row.is_seen]
    lines.append(["all", "", *(f"{sum(not row.passes(limit) for row in seen)} of {len(seen)}" for limit in LIMITS)])
    yield from _table(["found at", "worst parts", *(f"`{limit}`" for limit in LIMITS)], lines)


def _missed(rows: Sequence[Measured]) -> Iterator[str]:
    """Yield the number of faint defects, and how many of them each limit finds."""
    faint = [row for row in rows if row.is_defect and not row.is_seen]
    found = [f"{sum(not row.passes(limit) for row in faint)} at `{limit}`" for limit in LIMITS]
    yield f"{len(faint)} defects move no pixel by two steps; found: {', '.join(found)}"


def _by_change(rows: Iterable[Measured]) -> list[tuple[str, list[Measured]]]:
    groups: dict[str, list[Measured]] = {}
    for row in rows:
        groups.setdefault(row.change, []).append(row)
    return list(groups.items())


def _decibels(psnr: float) -> str:
    return "no difference" if psnr >= MOST_DB else f"{psnr:.1f} dB"


def _table(header: Sequence[str], lines: Iterable[Sequence[str]]) -> list[str]:
    return [f"| {' | '.join(cells)} |" for cells in (header, ["---"] * len(header), *lines)]


if __name__ == "__main__":
    main()
