"""What the fuzz scripts share: their command line, one case alone, and many cases in several processes."""

from __future__ import annotations

import argparse
import multiprocessing
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Protocol, TypeVar

from hsplat_cli.terminal import Reporter


class Judged(Protocol):
    """A verdict; no case may be `wrong`."""

    outcome: str


V = TypeVar("V", bound=Judged)


def fuzz(
    description: str | None,
    unit: str,
    judge_alone: Callable[[int, int, Path], V],
    judge: Callable[[int, int], V],
    report: Callable[[list[V], int, Path], int],
) -> int:
    """Judge cases by their seed and number: one alone, whose files stay in a folder, or many; return the exit code."""
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
        alone = judge_alone(arguments.seed, arguments.only, folder)
        print(f"{folder}\n{alone}")
        return int(alone.outcome == "wrong")
    numbers = range(arguments.first, arguments.first + arguments.number)
    verdicts: list[V] = []
    with (
        Reporter().progress(len(numbers), label="fuzz", unit=unit) as bar,
        ProcessPoolExecutor(arguments.workers, multiprocessing.get_context("spawn")) as pool,
    ):
        for verdict in pool.map(partial(judge, arguments.seed), numbers, chunksize=4):
            verdicts.append(verdict)
            bar.advance(f"{sum(each.outcome == 'wrong' for each in verdicts)} wrong")
    return report(verdicts, arguments.seed, failures)
