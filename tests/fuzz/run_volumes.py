"""Damaged volume files of every format, read and judged: the undamaged voxels, or a clear error, and no harm.

    python tests/fuzz/run_volumes.py [--files 20000] [--seed 1] [--workers 2] [--only NUMBER]

What fails is written to a folder, with the command that repeats it; then the exit code is 1. The tables at the end are
those of `docs/benchmarks/fuzz-volumes.md`.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import sys
from collections import Counter
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "support"), str(ROOT / "tests" / "fuzz")]
os.environ["OPENBLAS_NUM_THREADS"] = "1"  # forks have no threads

from judge_volumes import Verdict, judge_number, judge_volume  # noqa: E402
from volume_bases import make_bases, real_data  # noqa: E402
from volume_damage import make_case, write_case  # noqa: E402

from hsplat_cli.terminal import Reporter  # noqa: E402

OUTCOMES = ("same", "other", "refused", "wrong")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--files", type=int, default=20_000)
    parser.add_argument("--first", type=int, default=0, metavar="NUMBER", help="number of the first file")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--only", type=int, metavar="NUMBER", help="judge this file alone, and keep it")
    parser.add_argument("--failures", type=Path, default=Path("fuzz-failures"), help="folder for files that fail")
    arguments = parser.parse_args()
    if arguments.only is not None:
        folder = arguments.failures.absolute() / f"{arguments.seed}-{arguments.only}"
        folder.mkdir(parents=True)
        verdict = judge_volume(make_case(make_bases(real_data()), arguments.seed, arguments.only), folder)
        print(f"{folder}\n{verdict}")
        return int(verdict.outcome == "wrong")
    numbers = range(arguments.first, arguments.first + arguments.files)
    verdicts: list[Verdict] = []
    with (
        Reporter().progress(len(numbers), label="fuzz", unit="files") as bar,
        ProcessPoolExecutor(arguments.workers, multiprocessing.get_context("spawn")) as pool,
    ):
        for verdict in pool.map(partial(judge_number, arguments.seed), numbers, chunksize=8):
            verdicts.append(verdict)
            bar.advance(f"{sum(each.outcome == 'wrong' for each in verdicts)} wrong")
    print("\n".join(tables(verdicts)))
    wrong = [verdict for verdict in verdicts if verdict.outcome == "wrong"]
    for verdict in wrong:
        folder = arguments.failures.absolute() / f"{arguments.seed}-{verdict.index}"
        write_case(make_case(make_bases(real_data()), arguments.seed, verdict.index), folder)
        print(f"\npython tests/fuzz/run_volumes.py --seed {arguments.seed} --only {verdict.index}  # {folder}")
        print(f"  {verdict.base}, {verdict.damage}: {verdict.why.strip()}")
    return int(bool(wrong))


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
