"""The command line of fuzz scripts, one case alone, and many cases in several processes."""

from __future__ import annotations

import argparse
import multiprocessing
import sys
import tempfile
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import TypeVar

from hsplat_cli.terminal import Reporter

V = TypeVar("V")  # a verdict: `index`, `case` in words, `outcome`, and `why` it is wrong, which no case may be


def fuzz(
    description: str | None,
    unit: str,
    judge: Callable[[int, int, Path], V],
    write: Callable[[int, int, Path], object],
    summary: Callable[[list[V]], list[str]],
) -> int:
    """Judge cases by their seed and number: one alone, whose files stay in a folder, or many; return the exit code.

    judge: of a case in a folder. write: its files alone, for a case that fails. summary: lines about all verdicts.
    """
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(f"--{unit}", type=int, default=20_000, dest="number")
    parser.add_argument("--first", type=int, default=0, metavar="NUMBER", help=f"number of the first of the {unit}")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--only", type=int, metavar="NUMBER", help="judge this one alone, and keep its files")
    parser.add_argument("--failures", type=Path, default=Path("fuzz-failures"), help=f"folder for {unit} that fail")
    arguments = parser.parse_args()
    failures: Path = arguments.failures.absolute()
    if arguments.only is not None:
        folder = failures / f"{arguments.seed}-{arguments.only}"
        folder.mkdir(parents=True, exist_ok=True)
        alone = judge(arguments.seed, arguments.only, folder)
        print(f"{folder}\n{alone}")
        return int(alone.outcome == "wrong")
    numbers = range(arguments.first, arguments.first + arguments.number)
    verdicts: list[V] = []
    wrong: list[V] = []
    with (
        Reporter().progress(len(numbers), label="fuzz", unit=unit) as bar,
        ProcessPoolExecutor(arguments.workers, multiprocessing.get_context("spawn")) as pool,
    ):
        for verdict in pool.map(partial(judge_apart, judge, arguments.seed), numbers, chunksize=4):
            verdicts.append(verdict)
            wrong += [verdict] * (verdict.outcome == "wrong")
            bar.advance(f"{len(wrong)} wrong")
    print("\n".join(summary(verdicts)))
    for verdict in wrong:
        folder = failures / f"{arguments.seed}-{verdict.index}"
        write(arguments.seed, verdict.index, folder)
        print(f"\npython {sys.argv[0]} --seed {arguments.seed} --only {verdict.index}  # {folder}")
        print(f"  {verdict.case}: {verdict.why.strip()}")
    return int(bool(wrong))


def judge_apart(judge: Callable[[int, int, Path], V], seed: int, index: int) -> V:
    """Judge a case in a temporary folder."""
    with tempfile.TemporaryDirectory(prefix="hsplat-fuzz-", ignore_cleanup_errors=True) as folder:
        return judge(seed, index, Path(folder, "case"))  # a link to `..` finds nothing else
