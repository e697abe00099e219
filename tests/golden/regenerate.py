"""Draws golden frames again by `hsplat golden`: `python tests/golden/regenerate.py [CASE ...]`, by default all.

It prints what changes and by how much; look at that, and at the pictures, before you commit. The tests never run this.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from pathlib import Path

FOLDER = Path(__file__).parent
sys.path[:0] = [str(FOLDER), str(FOLDER.parents[1])]

from golden_cases import CASES, FRAMES  # noqa: E402


def main(names: list[str]) -> None:
    cases = {case.name: case for case in CASES}
    unknown = set(names) - set(cases)
    if unknown:
        sys.exit(f"no such case: {', '.join(sorted(unknown))}")
    for name in names or cases:
        with tempfile.TemporaryDirectory() as scratch:
            code = cases[name].keep(Path(scratch), "--update", "--yes", "--prune")
        if code != 0:
            sys.exit(code)
    if not names:
        for folder in sorted(FRAMES.iterdir()):
            if folder.name not in cases:
                shutil.rmtree(folder)
                print(f"{folder}: removed, because there is no such case")


if __name__ == "__main__":
    main(sys.argv[1:])
