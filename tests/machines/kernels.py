"""Run the tests with the kernels of every level that this processor offers, and with checked ones.

    python3 tests/machines/kernels.py levels [PYTEST ARGUMENTS]
    python3 tests/machines/kernels.py checked

`levels` runs the suite at each level below the processor's own. `checked` builds kernels that end the process at
undefined behaviour and at indices out of bounds, and runs with them the tests that compute with kernels and the
fuzzers; then it builds the usual ones again. Both need an editable installation: `pip install -e '.[dev]'`. A table at
the end has the last line of each run; the exit status is 1 where a test failed.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from renderer.kernels import LEVELS, processor_level, this_target

TESTS = Path(__file__).resolve().parents[1]
BUILD = (sys.executable, "-m", "renderer.kernels.build")
CHECKED_TESTS = ("analytic", "parity", "invariance", "extremes", "golden", "unit/test_kernels.py")
# Each with the number of its cases.
FUZZERS = {"run.py": ("--scenes", "300"), "run_volumes.py": ("--files", "1000")}


def main(what: str, *arguments: str) -> None:
    """Run the tests, print a table, and exit."""
    rows = run_levels(arguments) if what == "levels" else run_checked()
    print("\n| kernels | last line |\n|---|---|")
    for name, (_, last_line) in rows.items():
        print(f"| {name} | {last_line} |")
    sys.exit(any(failed for failed, _ in rows.values()))


def run_levels(arguments: tuple[str, ...]) -> dict[str, tuple[bool, str]]:
    """Return what `ended` returns for each lower level."""
    subprocess.run([*BUILD, "--all"], check=True)
    levels = [level for level in LEVELS[this_target().partition("-")[2]] if level < processor_level()]
    pytest = ("-m", "pytest", "-q", "-n", "auto", "--dist", "loadfile", *arguments)
    return {f"level {level}": ended(pytest, {"HSPLAT_PROCESSOR_LEVEL": str(level)}) for level in levels}


def run_checked() -> dict[str, tuple[bool, str]]:
    """Return what `ended` returns for the tests of kernels, and for each fuzzer."""
    subprocess.run([*BUILD, "--checked"], check=True)
    try:
        tests = (str(TESTS / name) for name in CHECKED_TESTS)
        rows = {"checked: tests": ended(("-m", "pytest", "-q", "-n", "auto", "--dist", "loadfile", *tests))}
        for name, options in FUZZERS.items():
            rows[f"checked: {name}"] = ended((str(TESTS / "fuzz" / name), *options))
    finally:
        subprocess.run([*BUILD, "--all"], check=True)
    return rows


def ended(command: tuple[str, ...], variables: dict[str, str] | None = None) -> tuple[bool, str]:
    """Run Python, and return whether it failed, and the last line that it printed."""
    environment = os.environ | (variables or {})
    run = subprocess.run([sys.executable, *command], env=environment, stdout=subprocess.PIPE, text=True, check=False)
    print(run.stdout)
    return run.returncode != 0, run.stdout.splitlines()[-1]


if __name__ == "__main__":
    main(*sys.argv[1:])
