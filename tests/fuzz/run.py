"""Random scenes and small volumes, every second one spoilt, drawn by the program and compared with the oracle.

    python tests/fuzz/run.py [--scenes 20000] [--seed 1] [--workers 2] [--only INDEX]

A legal scene must give the cells of `tests/support/oracle.py` and the picture that the reference rasteriser makes of
them, within a bound that follows from its numbers; a spoilt one an error with its place, or the right picture where
it turns out to be legal. What fails is written to a folder, with the command that repeats it; then the exit code is 1.
"""

from __future__ import annotations

import os
import sys
import tempfile
from collections import Counter
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "support"), str(ROOT / "tests" / "fuzz")]

from fuzzing import fuzz  # noqa: E402
from judge import Verdict, judge, make_case, write_case  # noqa: E402

from renderer.draw import GLRasterizer  # noqa: E402


def main() -> int:
    os.environ["LP_NUM_THREADS"] = "1"  # of Mesa's software renderer: the processes share the cores
    return fuzz(__doc__, "scenes", judge_alone, judge_scene, report)


def judge_alone(seed: int, index: int, folder: Path) -> Verdict:
    return judge(make_case(seed, index), folder, rasterizer_of_process())


@cache
def rasterizer_of_process() -> GLRasterizer:
    return GLRasterizer()


def judge_scene(seed: int, index: int) -> Verdict:
    """Judge a scene in a worker process."""
    with tempfile.TemporaryDirectory(prefix="hsplat-fuzz-") as folder:
        return judge(make_case(seed, index), Path(folder), rasterizer_of_process())


def report(verdicts: list[Verdict], seed: int, failures: Path) -> int:
    """Print a summary, and return 1 if any verdict is wrong."""
    for legal in (True, False):
        of_kind = [verdict for verdict in verdicts if verdict.legal == legal]
        counts = Counter(verdict.outcome for verdict in of_kind)
        print(f"{len(of_kind)} {'legal' if legal else 'spoilt'}: " + ", ".join(f"{n} {k}" for k, n in counts.items()))
    print("spoilt by: " + ", ".join(f"{k} {n}" for k, n in Counter(v.spoilt for v in verdicts if v.spoilt).items()))
    slowest = max(verdicts, key=lambda verdict: verdict.seconds, default=None)
    if slowest is not None:
        print(f"slowest: {slowest.seconds:.1f} s, scene {slowest.index}")
    wrong = [verdict for verdict in verdicts if verdict.outcome == "wrong"]
    for verdict in sorted(wrong, key=lambda verdict: verdict.index):
        folder = failures / f"{seed}-{verdict.index}"
        write_case(make_case(seed, verdict.index), folder)
        print(f"\npython tests/fuzz/run.py --seed {seed} --only {verdict.index}  # {folder}")
        print(f"  {verdict.spoilt or 'legal'}: {verdict.why.strip()}")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
