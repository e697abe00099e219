"""Write build/benchmarks/numerics.md, every extreme with the worst error measured.

Run it as `python tests/extremes/page.py`.
"""

from __future__ import annotations

import argparse
import importlib.util
import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), *(str(ROOT / "tests" / name) for name in ("support", "bench"))]

from extremes import CASES_ON_PAGE, Extreme, Section  # noqa: E402
from measuring import PAGES, write_page  # noqa: E402

from renderer.draw import SplatRasterizer  # noqa: E402
from renderer.system import commit  # noqa: E402


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--cases", type=int, default=CASES_ON_PAGE, help="random cases of each extreme")
    arguments = parser.parse_args()
    with SplatRasterizer() as rasterizer:
        device = rasterizer.device
    lines = [f"{arguments.cases} random cases a row, at commit {commit()} on {device}.", ""]
    with np.errstate(over="raise", divide="raise", invalid="raise"):
        for section in sections():
            lines += [f"## {section.title}", "", "| extreme | what makes it safe | measured | worst | bound |"]
            lines += ["|---|---|---|---|---|", *(_row(extreme, arguments.cases) for extreme in section.extremes), ""]
            lines += [section.notes, ""] if section.notes else []
    write_page(PAGES / "numerics.md", lines)


def sections() -> list[Section]:
    """Those of the test modules beside this file, in the order of their numbers of appearance: by file name."""
    found = []
    for path in sorted(Path(__file__).parent.glob("test_*.py")):
        spec = importlib.util.spec_from_file_location(path.stem, path)
        assert spec is not None and spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        sys.modules[path.stem] = module  # where dataclasses look for it
        spec.loader.exec_module(module)
        found.append(module.SECTION)
    return found


def _row(extreme: Extreme, cases: int) -> str:
    worst = extreme.measure(cases)
    print(f"{extreme.name}: {worst:.2g} ({extreme.bound:g})", flush=True)
    return f"| {extreme.name} | {extreme.method} | {extreme.quantity} | {worst:.2g} | {extreme.bound:.2g} |"


if __name__ == "__main__":
    main()
