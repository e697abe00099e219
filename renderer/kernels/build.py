"""Compile the kernels into libraries, with the compiler in the wheel `ziglang` and nothing else.

    python -m renderer.kernels.build              the library for this processor, for development
    python -m renderer.kernels.build --all        the libraries for all levels, as an installation does
    python -m renderer.kernels.build --all --target linux-aarch64 --out FOLDER    the libraries for another machine
    python -m renderer.kernels.build --checked    a library that ends the process at undefined behaviour

CXX in the environment names another clang, of version 22 or newer. Objects are linked without a C library: they need
`calloc`, `memset`, `fma` and the like, which every Python process has. The same sources give the same bytes, in any
folder.

An installation runs this file alone: it imports the standard library only. Every process that loads a library imports
it, too: modules that only compilation needs are imported where they are used.
"""

from __future__ import annotations

import hashlib
import os
import platform
import sys
from pathlib import Path

SOURCES = Path(__file__).resolve().parent / "sources"
# The folder of the libraries, in an editable installation and in a wheel.
BUILT = SOURCES.parent / "built"
# The file that lists the libraries: first a digest of the sources, then a line for each library, with its digest and
# its name.
MANIFEST = "libraries.txt"
# For each kind of machine, the levels of processors that libraries are compiled for. Each level has the compiler's name
# of the processor, and the number of float32 lanes in a vector. Level 2 of x86-64 is left out: it is no faster than 1.
LEVELS = {
    "x86_64": {1: ("x86_64", 4), 3: ("x86_64_v3", 8), 4: ("x86_64_v4", 16)},
    "aarch64": {0: ("generic", 4)},
}
# The sources that are compiled for each level, because they compute in vectors of lanes. All other sources are compiled
# for the lowest level alone, because a higher level does not make them faster.
_IN_LANES = (
    "bricks/brick_texels.cpp",
    "draw/march.cpp",
    "draw/mixture.cpp",
    "draw/extremum.cpp",
    "lighting/light_rays.cpp",
    "lighting/radiance.cpp",
)
# The machines that libraries can be made for, each with its name in zig. On Linux, libraries need glibc 2.17 (of 2012)
# or newer.
TARGETS = {
    "linux-x86_64": "x86_64-linux-gnu.2.17",
    "linux-aarch64": "aarch64-linux-gnu.2.17",
    "macos-x86_64": "x86_64-macos.11.0",
    "macos-aarch64": "aarch64-macos.11.0",
}
# The flags of the compiler in every build. Without fused products and sums, and without fast mathematics,
# results have the same bytes at every level. Without -g0, objects are ten times larger. Wide integers are for
# tables that the compiler computes (base/maths.h): clang for aarch64 has none of more than 128 bits unless it is told.
_FLAGS = (
    *("-c", "-x", "c++", "-std=c++20", "-O3", "-g0", "-fPIC", "-fvisibility=hidden", "-ffp-contract=off"),
    *("-fno-math-errno", "-fno-trapping-math", "-fwrapv", "-fno-exceptions", "-fno-rtti", "-fno-stack-protector"),
    *("-nostdinc++", "-Wall", "-Wextra", "-Werror", "-Wno-psabi", "-Xclang", "-fexperimental-max-bitint-width=320"),
)
# The further flags of a build without `--checked`: zig checks for undefined behaviour unless a flag turns this off.
_UNCHECKED = ("-fno-sanitize=undefined",)
# The further flags of a build with `--checked`, whose library ends the process at undefined behaviour.
_CHECKED = ("-DCHECKED", "-fsanitize=undefined,float-cast-overflow", "-fno-sanitize=alignment", "-fsanitize-trap=all")


def source_files() -> list[Path]:
    """Return the files in the folders of the sources, in order."""
    return sorted(path for path in SOURCES.rglob("*") if path.is_file())


def sources_digest() -> str:
    """Return a digest of the sources and of this file. A library with another digest is out of date."""
    digest = hashlib.blake2b(digest_size=16)
    for path in [Path(__file__), *source_files()]:
        digest.update(os.path.relpath(path, SOURCES).encode() + path.read_bytes())
    return digest.hexdigest()


def this_target() -> str:
    """Return the name in TARGETS of the machine that runs this."""
    machine = platform.machine().lower()
    system = {"darwin": "macos"}.get(sys.platform, sys.platform)
    return f"{system}-{ {'amd64': 'x86_64', 'arm64': 'aarch64'}.get(machine, machine) }"


def best_level(offered: int, target: str) -> int:
    """Return the highest level that kernels are compiled for on a target and that a processor can run.

    offered: the level that the processor offers. target: one of TARGETS.
    """
    return max(level for level in LEVELS[target.partition("-")[2]] if level <= offered)


def own_level(target: str) -> int:
    """Return the highest level that kernels are compiled for on a target and that this processor can run."""
    import ctypes
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        (library,) = build(Path(folder), this_target(), levels=set())
        return best_level(ctypes.CDLL(str(library)).processor_level(), target)


def build(out: Path, target: str, *, levels: set[int] | None = None, checked: bool = False) -> list[Path]:
    """Write libraries and their manifest into a folder, and return the libraries.

    target: one of TARGETS. levels: the levels to compile for; None for all. checked: whether to compile as with
    `--checked`.
    """
    import tempfile
    from concurrent.futures import ThreadPoolExecutor

    of_machine = LEVELS[target.partition("-")[2]]
    chosen = sorted(level for level in of_machine if levels is None or level in levels)
    out = out.resolve()
    out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as name, ThreadPoolExecutor(os.cpu_count()) as pool:
        folder = Path(name)

        def compile_source(source: Path, level: int) -> Path:
            (cpu, lanes), compiled = of_machine[level], folder / f"{source.parent.name}-{source.stem}-{level}.o"
            options = (*_FLAGS, *(_CHECKED if checked else _UNCHECKED), f"-DLANES={lanes}", f"-I{SOURCES}")
            _run(folder, *_compiler(target, cpu), *options, source, "-o", compiled)
            return compiled

        def link(name: str, objects: list[Path]) -> Path:
            library = out / f"{name}.so"
            # The library is written under another name, and then renamed: a running process keeps the file that it has
            # loaded.
            unfinished = library.with_suffix(f".{os.getpid()}")
            _run(folder, *_linker(target, unfinished), *objects)
            unfinished.replace(library)
            return library

        lowest = min(of_machine)
        in_lanes = [SOURCES / name for name in _IN_LANES]
        begun = {level: [pool.submit(compile_source, source, level) for source in in_lanes] for level in chosen}
        others = sorted(set(SOURCES.rglob("*.cpp")).difference(in_lanes)) if chosen else []
        shared = [pool.submit(compile_source, source, lowest) for source in others]
        objects = {f"kernels-{level}": [*of_level, *shared] for level, of_level in begun.items()}
        objects["processor"] = [pool.submit(compile_source, SOURCES / "base" / "processor.cc", lowest)]
        libraries = [link(name, [one.result() for one in made]) for name, made in objects.items()]
    for other in set(out.glob("*.so")).difference(libraries):
        other.unlink()  # a library of an earlier build, perhaps of other sources
    _write_manifest(out)
    return libraries


def _compiler(target: str, cpu: str) -> list[str]:
    if "CXX" in os.environ:
        # clang takes a level of x86-64 as an architecture, and every other processor by its name.
        option = f"-march={cpu.replace('_', '-')}" if cpu.startswith("x86_64") else f"-mcpu={cpu}"
        return [os.environ["CXX"], option]
    return [sys.executable, "-m", "ziglang", "c++", "-target", TARGETS[target], f"-mcpu={cpu}"]


def _linker(target: str, library: Path) -> list[str]:
    if "CXX" in os.environ:
        undefined = ("-undefined", "dynamic_lookup") if target.startswith("macos") else ()  # Python's process has them
        return [os.environ["CXX"], "-shared", "-nostdlib", *undefined, "-o", str(library)]
    # `zig build-lib` links, as `zig c++` would first compile its own C library, for minutes.
    options = ("-dynamic", "-fstrip", "-fno-compiler-rt", "-fno-ubsan-rt", "-fallow-shlib-undefined")
    # On macOS a library contains its own name, which would be this path, another one in each build.
    name = ("-install_name", f"{library.stem}.so") if target.startswith("macos") else ()
    command = [sys.executable, "-m", "ziglang", "build-lib", "-target", TARGETS[target]]
    return [*command, *options, *name, f"-femit-bin={library}"]


def _run(folder: Path, *command: object) -> None:
    """Run a command in a folder. Raise RuntimeError with its output if it fails."""
    import subprocess

    words = [str(word) for word in command]
    run = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)
    if run.returncode != 0:
        raise RuntimeError(f"`{' '.join(words)}` failed:\n{run.stdout}{run.stderr}")


def _write_manifest(out: Path) -> None:
    lines = [sources_digest()]
    for library in sorted(out.glob("*.so")):
        lines.append(f"{hashlib.blake2b(library.read_bytes(), digest_size=16).hexdigest()} {library.name}")
    (out / MANIFEST).write_text("\n".join(lines) + "\n", encoding="ascii")


def main() -> None:
    """Build the libraries that the command line asks for, and print their sizes."""
    import argparse
    import time

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=BUILT, help="a folder for the libraries")
    parser.add_argument("--all", action="store_true", help="all levels")
    parser.add_argument("--target", default=this_target(), choices=TARGETS, help="another machine to compile for")
    parser.add_argument("--checked", action="store_true", help="trap undefined behaviour and indices out of bounds")
    options = parser.parse_args()
    begin = time.perf_counter()
    levels = None if options.all else {own_level(options.target)}
    for library in build(options.out, options.target, levels=levels, checked=options.checked):
        print(f"{library.name}: {library.stat().st_size} bytes")
    print(f"{time.perf_counter() - begin:.2f} s")


if __name__ == "__main__":
    try:
        main()
    except RuntimeError as error:  # no traceback: the compiler's messages are enough
        sys.exit(str(error))
