"""Measure which limits of a comparison find which defects, and at which PSNR of the worst part.

`python tests/golden/separation.py` draws several scenes of bricks and of splats with every defect and every harmless
change, and writes the tables and lists of docs/benchmarks/goldens.md to build/benchmarks/goldens.md.

Drivers of OpenGL that a machine has beside its own are named with the variables that make a program load them:

    --driver "another Mesa: LD_LIBRARY_PATH=... LIBGL_DRIVERS_PATH=... __EGL_VENDOR_LIBRARY_FILENAMES=..."
"""

from __future__ import annotations

import argparse
import shlex
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

FOLDER = Path(__file__).resolve().parent
ROOT = FOLDER.parents[1]
sys.path[:0] = [str(ROOT), str(FOLDER), str(ROOT / "tests" / "support")]

from defects import DEFECTS  # noqa: E402
from harmless import BRICK_MACHINES, HARMLESS, SPLAT_MACHINES, Machine  # noqa: E402
from measured import Measured, measured, on_machine  # noqa: E402
from subjects import BRICKS, SPLATS, Shot, Subject  # noqa: E402

from renderer.accuracy import MOST_DB  # noqa: E402
from renderer.draw import BrickRasterizer, SplatRasterizer  # noqa: E402
from renderer.system import commit  # noqa: E402


@dataclass(frozen=True)
class Part:
    """The pictures of one primitive, and the limits that its columns of the tables are about.

    finding: for defects. passing: for harmless changes.
    """

    subjects: Sequence[Subject]
    machines: Sequence[Machine]
    finding: Sequence[str]
    passing: Sequence[str]


PARTS = {
    "bricks": Part(BRICKS, BRICK_MACHINES, ("stated accuracy", "45 dB", "40 dB"), ("same bytes", "45 dB")),
    "splats": Part(SPLATS, SPLAT_MACHINES, ("45 dB", "40 dB"), ("same bytes", "40 dB")),
}
# The measurements of each primitive.
Found = Mapping[str, Sequence[Measured]]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--driver", action="append", default=[], type=_driver, metavar="NAME: KEY=VALUE ...")
    drivers: list[Machine] = parser.parse_args().driver
    found = dict[str, Sequence[Measured]]()
    with SplatRasterizer() as of_splats, BrickRasterizer() as of_bricks:
        for primitive in PARTS:
            own = drivers if primitive == "splats" else []
            found[primitive] = _measure(primitive, own, of_splats, of_bricks)
        by = f"`python tests/golden/separation.py`, commit {commit()}, {of_bricks.device}; {of_splats.device}"
    file = ROOT / "build" / "benchmarks" / "goldens.md"
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text("\n".join([by, "", *_defects(found), "", *_lists(found), "", *_harmless(found), ""]), "utf-8")


def _driver(text: str) -> Machine:
    name, _, settings = text.partition(": ")
    pairs = [entry.partition("=") for entry in shlex.split(settings)]
    return Machine(name, "40 dB", {key: value for key, _, value in pairs})


def _measure(
    primitive: str, drivers: Sequence[Machine], of_splats: SplatRasterizer, of_bricks: BrickRasterizer
) -> list[Measured]:
    """Measure all changes of all subjects of a primitive."""
    rows: list[Measured] = []
    shots = [Shot(subject, of_splats, of_bricks) for subject in PARTS[primitive].subjects]
    for shot in shots:
        found = (measured(shot, change) for change in (*HARMLESS, *DEFECTS))
        rows += _printed(row for row in found if row is not None)
    for machine in (*PARTS[primitive].machines, *drivers):
        rows += _printed(on_machine(shots, machine, primitive)[1])
    return rows


def _printed(rows: Iterable[Measured]) -> Iterator[Measured]:
    for row in rows:
        figures = row.figures
        states = "{:.1f} and {:.1f} dB".format(*row.stated)
        print(f"{row.subject}, {row.change}: part {figures.part_psnr:.1f} dB, picture {figures.psnr:.1f} dB, "
              f"largest {figures.largest:.0f}, stated {states}", flush=True)  # fmt: skip
        yield row


def _defects(found: Found) -> Iterator[str]:
    """Yield a table of the defects that 45 dB misses in some frame, with the PSNR of their worst parts, in dB.

    The row of all has the other defects, too. Defects that cannot be seen are left out.
    """
    seen = _by_change(found, lambda row: row.is_defect and row.is_seen)
    lines = []
    for change, groups in seen.items():
        if not _is_found("45 dB", groups):
            lines.append([change, *_cells(groups, _span, lambda part: part.finding, is_passing=False)])
    every: Groups = {}
    for groups in seen.values():
        for primitive, rows in groups.items():
            every.setdefault(primitive, []).extend(rows)
    lines.append(["all", *_cells(every, lambda rows: "", lambda part: part.finding, is_passing=False)])
    columns = ["bricks: worst part, dB", "found", "splats: worst part, dB", "found"]
    yield from _table(["defect", *columns], lines)


def _lists(found: Found) -> Iterator[str]:
    """Yield the numbers of defects that are seen and that are not, and the defects that limits find in every frame."""
    rows = [row for group in found.values() for row in group if row.is_defect]
    num_seen, by_45 = sum(row.is_seen for row in rows), sum(not row.passes("45 dB") and not row.is_seen for row in rows)
    yield f"- {num_seen} are seen, and {len(rows) - num_seen} are fainter; 45 dB finds {by_45 or 'none'} of these."
    seen = _by_change(found, lambda row: row.is_defect and row.is_seen)
    by_40 = [change for change, groups in seen.items() if _is_found("40 dB", groups) and _is_found("45 dB", groups)]
    only_45 = [change for change, groups in seen.items() if _is_found("45 dB", groups) and change not in by_40]
    yield f"- 45 dB, but not 40 dB, finds in every frame: {'; '.join(only_45)}."
    yield f"- Both find in every frame: {'; '.join(by_40)}."


def _harmless(found: Found) -> Iterator[str]:
    """Yield a table of harmless changes: their worst part, and how many pictures pass limits."""
    lines = [
        [change, *_cells(groups, lambda rows: _decibels(_parts(rows)[0]), lambda part: part.passing, is_passing=True)]
        for change, groups in _by_change(found, lambda row: not row.is_defect).items()
    ]
    columns = ["bricks: worst part", "passed", "splats: worst part", "passed"]
    yield from _table(["change", *columns], lines)


# The measurements of one change, by primitives.
Groups = dict[str, list[Measured]]


def _by_change(found: Found, is_wanted: Callable[[Measured], bool]) -> dict[str, Groups]:
    """Return the wanted measurements by changes, in the order of changes."""
    groups: dict[str, Groups] = {}
    for primitive, rows in found.items():
        for row in filter(is_wanted, rows):
            groups.setdefault(row.change, {}).setdefault(primitive, []).append(row)
    return groups


def _is_found(limit: str, groups: Groups) -> bool:
    """Return whether a limit finds a defect in every frame."""
    return not any(row.passes(limit) for rows in groups.values() for row in rows)


def _cells(
    groups: Groups,
    worst: Callable[[Sequence[Measured]], str],
    limits: Callable[[Part], Sequence[str]],
    *,
    is_passing: bool,
) -> Iterator[str]:
    """Yield two cells for each primitive: the worst part, and for each limit how many frames pass it or do not."""
    for primitive, part in PARTS.items():
        rows = groups.get(primitive, [])
        counts = (sum(row.passes(limit) == is_passing for row in rows) for limit in limits(part))
        yield from (worst(rows), ", ".join(f"{count}/{len(rows)}" for count in counts)) if rows else ("", "")


def _parts(rows: Sequence[Measured]) -> list[float]:
    """Return the PSNR of the worst parts, the worst first."""
    return sorted(row.figures.part_psnr for row in rows)


def _span(rows: Sequence[Measured]) -> str:
    parts = _parts(rows)
    return f"{parts[0]:.0f} to {parts[-1]:.0f}"


def _decibels(psnr: float) -> str:
    return "no difference" if psnr >= MOST_DB else f"{psnr:.1f} dB"


def _table(header: Sequence[str], lines: Iterable[Sequence[str]]) -> list[str]:
    return [f"| {' | '.join(cells)} |" for cells in (header, ["---"] * len(header), *lines)]


if __name__ == "__main__":
    main()
