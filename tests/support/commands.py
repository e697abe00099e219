"""Run `hsplat`, or programs that use its library, in other processes, and list the files that they leave."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from hsplat_cli import main

CODE = Path(main.__file__).parents[1]
HSPLAT = (sys.executable, "-m", "hsplat_cli")


def environment(**variables: str) -> dict[str, str]:
    """Return this process's environment with these variables, in which Python finds the hsplat under test."""
    return os.environ | {"PYTHONPATH": str(CODE)} | variables


def hsplat(*arguments: str, **variables: str) -> subprocess.CompletedProcess[str]:
    """Run `hsplat` with these arguments to its end. variables: further variables of its environment."""
    return python("-m", "hsplat_cli", *arguments, **variables)


def python(*arguments: str | bytes, folder: str | Path = ".", **variables: str) -> subprocess.CompletedProcess[str]:
    """Run Python, which finds the hsplat under test, in a folder to its end."""
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=folder, check=False, capture_output=True, text=True, env=environment(**variables),
    )  # fmt: skip


@contextmanager
def other_process(imports: str, block: str) -> Iterator[int]:
    """Run another process that enters a `with` block, such as one that holds a lock; yield the process's id.

    The process leaves its block when this block ends. imports, block: its Python code.
    """
    program = (
        f"import sys\nfrom pathlib import Path\n{imports}\nwith {block}:\n    print(flush=True)\n    sys.stdin.read()"
    )
    with subprocess.Popen(
        [sys.executable, "-c", program], env=environment(), stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"\n"
        yield process.pid
        process.communicate(b"")


def files(folder: str | Path) -> list[str]:
    """Return the names of all files below a folder."""
    return sorted(str(path.relative_to(folder)) for path in Path(folder).rglob("*") if path.is_file())
