"""Random scenes and small volumes, every second one spoilt, drawn by the program and compared with a reference.

    python tests/fuzz/run.py [--scenes 20000] [--seed 1] [--workers 2] [--only INDEX]

A legal scene must give the picture that the reference rasteriser makes of its splats or bricks, within a bound that
follows from its numbers; a spoilt one an error with its place, or the right picture where it turns out to be legal.
Cuts, splats and orders have tests of their own (tests/analytic/). What fails is written to a folder, with the command
that repeats it; then the exit code is 1.
"""

from __future__ import annotations

import os
import sys
from collections import Counter
from collections.abc import Iterable
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "support"), str(ROOT / "tests" / "fuzz")]

from fuzzing import fuzz  # noqa: E402
from judge import LEGAL, Verdict, judge, make_case, write_case  # noqa: E402

from renderer.draw import BrickRasterizer, Rasterizer, SplatRasterizer  # noqa: E402
from renderer.scene import Scene  # noqa: E402


def main() -> int:
    os.environ["LP_NUM_THREADS"] = "1"  # of Mesa's software renderer: the processes share the cores
    return fuzz(__doc__, "scenes", judge_scene, write_scene, summary)


@cache
def splat_rasterizer() -> SplatRasterizer:
    return SplatRasterizer()


def rasterizer_for(scene: Scene) -> Rasterizer:
    return splat_rasterizer() if scene.needs_opengl else BrickRasterizer(num_threads=1)


def judge_scene(seed: int, index: int, folder: Path) -> Verdict:
    return judge(make_case(seed, index), folder, rasterizer_for)


def write_scene(seed: int, index: int, folder: Path) -> Path:
    return write_case(make_case(seed, index), folder)


def summary(verdicts: list[Verdict]) -> list[str]:
    legal, spoilt = ([v for v in verdicts if (v.case == LEGAL) == is_legal] for is_legal in (True, False))
    lines = [
        f"{len(legal)} legal: {_counts(verdict.outcome for verdict in legal)}",
        f"{len(spoilt)} spoilt: {_counts(verdict.outcome for verdict in spoilt)}",
        f"spoilt by: {_counts(verdict.case for verdict in spoilt)}",
    ]
    slowest = max(verdicts, key=lambda verdict: verdict.seconds, default=None)
    return lines if slowest is None else [*lines, f"slowest: {slowest.seconds:.1f} s, scene {slowest.index}"]


def _counts(words: Iterable[str]) -> str:
    return ", ".join(f"{num} {word}" for word, num in Counter(words).items())


if __name__ == "__main__":
    sys.exit(main())
