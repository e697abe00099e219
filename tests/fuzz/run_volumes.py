"""Damaged volume files of every format, read and judged: the undamaged voxels, or a clear error, and no harm.

    python tests/fuzz/run_volumes.py [--files 20000] [--seed 1] [--workers 2] [--only NUMBER]

What fails is written to a folder, with the command that repeats it; then the exit code is 1. The tables at the end are
those of `docs/benchmarks/fuzz-volumes.md`.
"""

from __future__ import annotations

import os
import sys
from collections import Counter
from collections.abc import Callable, Iterable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), *(str(ROOT / "tests" / name) for name in ("support", "statements", "fuzz"))]
os.environ["OPENBLAS_NUM_THREADS"] = "1"  # forks have no threads

from fuzzing import fuzz  # noqa: E402
from judge_volumes import Verdict, judge_number  # noqa: E402
from volume_bases import make_bases, real_data  # noqa: E402
from volume_damage import make_case, write_case  # noqa: E402

OUTCOMES = ("same", "other", "refused", "wrong")


def main() -> int:
    return fuzz(__doc__, "files", judge_number, write_number, tables)


def write_number(seed: int, index: int, folder: Path) -> Path:
    return write_case(make_case(make_bases(real_data()), seed, index), folder)


def tables(verdicts: list[Verdict]) -> list[str]:
    """Return tables of the outcomes by format and by damage, and the lines about what was slowest and largest."""
    lines = [f"{len(verdicts)} files"]
    lines += ["", *_table("format", verdicts, lambda verdict: verdict.base.split(" ", maxsplit=1)[0])]
    lines += ["", *_table("damage", verdicts, lambda verdict: verdict.damage.split(":")[0].removesuffix(" unpacked"))]
    for is_in_child, where in ((False, "in one process"), (True, "with a child process")):
        own = [verdict for verdict in verdicts if verdict.in_child == is_in_child] or verdicts[:1]
        slowest = max(own, key=lambda verdict: verdict.seconds)
        largest = max(own, key=lambda verdict: verdict.num_bytes)
        lines += ["", f"{len(own)} files were read {where}."]
        lines += [f"Slowest: {slowest.seconds:.1f} s, {slowest.base}, {slowest.damage} (file {slowest.index})."]
        lines += [
            f"Most memory: {largest.num_bytes >> 20} MiB, {largest.base}, {largest.damage} (file {largest.index})."
        ]
    return lines


def _table(name: str, verdicts: Iterable[Verdict], key: Callable[[Verdict], str]) -> list[str]:
    """Return a table of the outcomes, a row for each key."""
    counts = Counter((key(verdict), verdict.outcome) for verdict in verdicts)
    names = sorted({row for row, _ in counts})
    rows = {row: [counts[row, outcome] for outcome in OUTCOMES] for row in names}
    rows["all"] = [sum(column) for column in zip(*rows.values(), strict=True)]
    lines = [[name, "files", "same voxels", "other voxels", "refused", "wrong"], ["---"] * 6]
    lines += [[row, *map(str, [sum(numbers), *numbers])] for row, numbers in rows.items()]
    return ["| " + " | ".join(line) + " |" for line in lines]


if __name__ == "__main__":
    sys.exit(main())
