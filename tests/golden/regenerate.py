"""Draws golden frames anew and keeps them: `python tests/golden/regenerate.py [CASE ...]`, by default all.

Look at what has changed (`git diff --stat`, and the pictures) before you commit it. The tests never run this.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

FOLDER = Path(__file__).parent
sys.path[:0] = [str(FOLDER), str(FOLDER.parents[1])]

from golden_cases import CASES, FRAMES  # noqa: E402
from golden_compare import compare, read_frame  # noqa: E402


def main(names: list[str]) -> None:
    """Replace the frames that differ visibly; those that do not are kept, so that a repeated run changes nothing."""
    unknown = set(names) - {case.name for case in CASES}
    if unknown:
        sys.exit(f"no such case: {', '.join(sorted(unknown))}")
    for case in CASES:
        if names and case.name not in names:
            continue
        with tempfile.TemporaryDirectory() as folder:
            for actual in case.draw(Path(folder)):
                _keep(actual, FRAMES / actual.name)
    if not names:
        for path in sorted(FRAMES.glob("*.png")):
            if path.stem.rpartition("-")[0] not in {case.name for case in CASES}:
                path.unlink()
                print(f"{path.name}: removed")


def _keep(actual: Path, golden: Path) -> None:
    golden.parent.mkdir(exist_ok=True)
    if not golden.exists():
        print(f"{golden.name}: new")
    else:
        old, new = read_frame(golden), read_frame(actual)
        if old.shape == new.shape and not compare(old, new).is_visible:
            return
        print(f"{golden.name}: changed")
    golden.write_bytes(actual.read_bytes())


if __name__ == "__main__":
    main(sys.argv[1:])
