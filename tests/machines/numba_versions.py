"""Test compiled loops with the oldest and the newest numba that pyproject.toml allows.

    python3 tests/machines/numba_versions.py FOLDER

Each version gets a virtual environment in FOLDER, with the packages that hsplat and these tests need. There the tests
of lanes, of the cache, of golden frames and of bricks against a float64 reference run. A table at the end says what
passed. The exit status is 1 where a test failed.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
TESTS = (
    *("tests/unit/test_cpu_bricks.py", "tests/system/test_jit.py"),
    *("tests/golden/test_golden.py", "tests/parity/test_brick_parity.py"),
)
OF_TESTS = ("hypothesis>=6.90", "pytest>=7.4", "pytest-xdist>=3.8", "scipy>=1.11")


def main() -> None:
    """Run the tests with both versions, and print the table."""
    lowest, beyond = re.findall(r'"numba>=([\d.]+),<([\d.]+)"', (ROOT / "pyproject.toml").read_text("utf-8"))[0]
    rows = [tested_with(wanted, Path(sys.argv[1])) for wanted in (f"numba=={lowest}.*", f"numba<{beyond}")]
    print(
        "\n| numba | NumPy | Python | last line of the tests |",
        "|---|---|---|---|",
        *(row for _, row in rows),
        sep="\n",
    )
    sys.exit(any(failed for failed, _ in rows))


def tested_with(wanted: str, folder: Path) -> tuple[bool, str]:
    """Return whether the tests failed, and the row of a version."""
    place = folder / re.sub(r"\W", "_", wanted)
    subprocess.run([sys.executable, "-m", "venv", place], check=True)
    python = str(place / "bin" / "python")
    subprocess.run([python, "-m", "pip", "install", "--quiet", wanted, f"{ROOT}[compare]", *OF_TESTS], check=True)
    subprocess.run(
        [python, "-m", "pip", "uninstall", "--quiet", "--yes", "hsplat"], check=True
    )  # the checkout is tested
    environment = os.environ | {"PYTHONPATH": str(ROOT), "NUMBA_CACHE_DIR": str(place / "kernels")}
    command = [python, "-m", "pytest", "-q", *TESTS]
    tests = subprocess.run(command, cwd=ROOT, env=environment, stdout=subprocess.PIPE, text=True, check=False)
    print(tests.stdout)
    show = "import numba, numpy, platform; print(numba.__version__, numpy.__version__, platform.python_version())"
    versions = subprocess.run([python, "-c", show], stdout=subprocess.PIPE, text=True, check=True).stdout.split()
    return tests.returncode != 0, f"| {' | '.join(versions)} | {tests.stdout.splitlines()[-1]} |"


if __name__ == "__main__":
    main()
