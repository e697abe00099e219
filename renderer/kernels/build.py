"""Compile the kernels into libraries, with the compiler in the wheel `ziglang`. Needs nothing else.

    python -m renderer.kernels.build              the library for this processor, for development
    python -m renderer.kernels.build --all        those of all levels, as an installation does
    python -m renderer.kernels.build --checked    this processor's, which ends the process at undefined behaviour

CXX in the environment names another clang. Objects are linked without a C library: they need `malloc`, `memset`, `fma`
and the like, which every Python process has. The same sources give the same bytes, in any folder.

An installation runs this file alone, so it imports the standard library only.
"""

from __future__ import annotations

import argparse
import ctypes
import hashlib
import os
import platform
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

SOURCES = Path(__file__).resolve().parent / "sources"
# Where an editable installation has its libraries, and a wheel, in the same place of its package.
BUILT = SOURCES.parent / "built"
# What says which libraries there are: a digest of the sources, then a line for each library, its digest and its name.
MANIFEST = "libraries.txt"
# By machine: levels, the name of the processor, and its lanes of float32. Level k needs `processor_level() >= k`.
LEVELS = {
    "x86_64": {1: ("x86_64", 4), 2: ("x86_64_v2", 4), 3: ("x86_64_v3", 8), 4: ("x86_64_v4", 16)},
    "aarch64": {0: ("generic", 4)},
}
# No contraction and no fast mathematics: results are the same bytes at every level. zig adds a sanitizer unless it is
# told not to. Without -g0, objects are ten times larger.
_FLAGS = (
    *("-c", "-x", "c++", "-std=c++20", "-O3", "-g0", "-fPIC", "-fvisibility=hidden", "-ffp-contract=off"),
    *("-fno-math-errno", "-fno-trapping-math", "-fwrapv", "-fno-exceptions", "-fno-rtti", "-fno-stack-protector"),
    *("-nostdinc++", "-Wall", "-Wextra", "-Werror", "-Wno-psabi"),
)
_UNCHECKED = ("-fno-sanitize=undefined",)
_CHECKED = ("-DCHECKED", "-fsanitize=undefined,float-cast-overflow", "-fno-sanitize=alignment", "-fsanitize-trap=all")


def sources_digest() -> str:
    """Return a digest of all that libraries are made of."""
    digest = hashlib.blake2b(digest_size=16)
    for path in [Path(__file__), *sorted(SOURCES.iterdir())]:
        digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()


def build(out: Path, *, levels: set[int] | None = None, machine: str = "", checked: bool = False) -> list[Path]:
    """Write libraries and their manifest into a folder, and return the libraries.

    levels: those of the machine, if not all. machine: another one than this, by its name in `uname -m`.
    """
    machine = _machine_name(machine or platform.machine())
    of_machine = {level: one for level, one in LEVELS[machine].items() if levels is None or level in levels}
    out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as name, ThreadPoolExecutor(os.cpu_count()) as pool:
        folder = Path(name)

        def compile_source(source: Path, level: int) -> Path:
            (cpu, lanes), compiled = LEVELS[machine][level], folder / f"{source.stem}-{level}.o"
            options = (*_FLAGS, *(_CHECKED if checked else _UNCHECKED), f"-DLANES={lanes}")
            _run(*_compiler(machine, cpu), *options, source, "-o", compiled)
            return compiled

        def link(name: str, objects: list[Path]) -> Path:
            library = out / f"{name}.so"
            # Under another name until it is whole: a running process keeps the one that it has loaded.
            unfinished = library.with_suffix(f".{os.getpid()}")
            _run(*_linker(), "-shared", *objects, "-o", unfinished)
            unfinished.replace(library)
            return library

        # The largest first: they take longest.
        sources = sorted(SOURCES.glob("*.cpp"), key=lambda path: path.stat().st_size, reverse=True)
        objects = {
            f"kernels-{level}": [pool.submit(compile_source, source, level) for source in sources]
            for level in of_machine
        }
        lowest = min(LEVELS[machine])
        objects["processor"] = [pool.submit(compile_source, SOURCES / "processor.cc", lowest)]
        libraries = [link(name, [one.result() for one in made]) for name, made in objects.items()]
    _write_manifest(out)
    return libraries


def _machine_name(name: str) -> str:
    return {"amd64": "x86_64", "arm64": "aarch64"}.get(name.lower(), name.lower())


def _compiler(machine: str, cpu: str) -> list[str]:
    if "CXX" in os.environ:
        return [os.environ["CXX"], f"-march={cpu.replace('_', '-').replace('x86-64', 'x86-64', 1)}"]
    return [sys.executable, "-m", "ziglang", "c++", "-target", f"{machine}-linux-gnu.2.17", f"-mcpu={cpu}"]


def _linker() -> list[str]:
    if "CXX" in os.environ:
        return [os.environ["CXX"], "-nostdlib", "-Wl,-s"]
    return [sys.executable, "-m", "ziglang", "ld.lld", "-s", "-z", "relro", "-z", "now"]


def _run(*command: object) -> None:
    """Run a command, and raise what it says if it fails."""
    words = [str(word) for word in command]
    run = subprocess.run(words, capture_output=True, text=True, check=False)
    if run.returncode != 0:
        raise RuntimeError(f"`{' '.join(words)}` failed:\n{run.stdout}{run.stderr}")


def _write_manifest(out: Path) -> None:
    lines = [sources_digest()]
    for library in sorted(out.glob("*.so")):
        lines.append(f"{hashlib.blake2b(library.read_bytes(), digest_size=16).hexdigest()} {library.name}")
    (out / MANIFEST).write_text("\n".join(lines) + "\n", encoding="ascii")


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=BUILT, help="a folder for the libraries")
    parser.add_argument("--all", action="store_true", help="all levels")
    parser.add_argument("--machine", default="", help="compile for another machine, all its levels")
    parser.add_argument("--checked", action="store_true", help="trap undefined behaviour and indices out of bounds")
    options = parser.parse_args()
    begin, levels = time.perf_counter(), None
    if not options.all and not options.machine:
        (library,) = build(options.out, levels=set())
        levels = {ctypes.CDLL(str(library)).processor_level()}
    for library in build(options.out, levels=levels, machine=options.machine, checked=options.checked):
        print(f"{library.name}: {library.stat().st_size} bytes")
    print(f"{time.perf_counter() - begin:.2f} s")


if __name__ == "__main__":
    main()
