"""Run the tests with loops that are compiled for other processors of the x86-64 kind, as this one can run them, too.

    python3 tests/machines/processors.py [PYTEST ARGUMENTS]

The processors are haswell, with AVX2 and without AVX-512, and x86-64 itself, without AVX and without fused products.
Each run compiles into a cache of its own. The exit status is 1 where a test failed.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile

PROCESSORS = ("haswell", "x86-64")


def main() -> None:
    """Run the tests for each processor, and print the last line of each run."""
    ends = {processor: tested_for(processor, sys.argv[1:]) for processor in PROCESSORS}
    for processor, (_, last_line) in ends.items():
        print(f"| {processor} | {last_line} |")
    sys.exit(any(failed for failed, _ in ends.values()))


def tested_for(processor: str, arguments: list[str]) -> tuple[bool, str]:
    """Return whether the tests failed, and the last line that they printed."""
    with tempfile.TemporaryDirectory(prefix="kernels-") as caches:
        chosen = {"NUMBA_CPU_NAME": processor, "NUMBA_CPU_FEATURES": "", "NUMBA_CACHE_DIR": caches}
        command = [sys.executable, "-m", "pytest", "-q", "-n", "auto", "--dist", "loadfile", *arguments]
        tests = subprocess.run(command, env=os.environ | chosen, stdout=subprocess.PIPE, text=True, check=False)
    print(tests.stdout)
    return tests.returncode != 0, tests.stdout.splitlines()[-1]


if __name__ == "__main__":
    main()
