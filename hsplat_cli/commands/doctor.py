"""Run `hsplat doctor`: say what is installed, what draws and encodes, what is missing, and how much room there is."""

from __future__ import annotations

import json
import re
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from importlib import metadata
from pathlib import Path

import click

from hsplat_cli.commands.shared_options import FILE
from hsplat_cli.terminal import Machine, Reporter, describe_machine, format_table
from renderer.errors import HsplatError, install_line
from renderer.system import MemoryShare, address_space_hint, free_bytes, join_lines, num_cores, package_versions

# The extras for users, each with the work that needs it.
EXTRAS = {
    "tiff": "compressed TIFF files",
    "dicom": "compressed DICOM files",
    "hdf5": "volumes in HDF5 and netCDF-4 files",
    "vtk": "volumes of VTK",
    "zarr": "OME-Zarr, Zarr, N5 and Neuroglancer",
    "exr": "EXR frames",
    "compare": "FLIP in comparisons",
    "measure": "FLIP and SSIM in measurements",
    "cluster": "drawing on a Dask cluster",
}
# The version of a package that is missing, as in package_versions.
_MISSING = "not installed"


@dataclass(frozen=True)
class _Part:
    """A part of the installation.

    found: its version or its description; empty if it is missing or fails. problem: why. remedy: a line that mends it.
    purpose: the work that needs it; empty if all work does.
    """

    name: str
    found: str
    problem: str = ""
    remedy: str = ""
    purpose: str = ""


@dataclass(frozen=True)
class _Room:
    """The room for work: the number of processors, and bytes that are free; None for an unknown number.

    memory: for this process. bricks: the part of it that drawing may take. temporary: the folder of temporary files.
    disk: on the disk of this folder. limit: a sentence on a limit of the address space, or None.
    """

    processors: int
    memory: int | None
    bricks: int
    temporary: str
    disk: int
    limit: str | None


@dataclass(frozen=True)
class _Cache:
    """A folder for `--cache`: its bytes, and whether it is there."""

    folder: str
    exists: bool
    bytes: int


@dataclass(frozen=True)
class _Findings:
    """The facts that `hsplat doctor` prints, as text or as JSON.

    can_draw: whether films can be drawn. python: the path of Python. needed: the parts without which no film can be
    drawn. optional: further parts.
    """

    can_draw: bool
    machine: Machine
    python: str
    needed: list[_Part]
    optional: list[_Part]
    room: _Room
    cache: _Cache | None


@click.command()
@click.option("--cache", type=FILE, metavar="FOLDER", help="Say how much this folder for --cache has kept.")
@click.option("--json", "as_json", is_flag=True, help="Print the same as JSON.")
def doctor(cache: Path | None, as_json: bool) -> None:
    """Say what is installed, what draws, and what is missing.

    For each missing part there is the line that installs it. doctor changes nothing. It exits with 1 where films cannot
    be drawn. OpenGL is for splats alone, and the extras are for the files that they name.
    """
    findings = _find(cache)
    lines = json.dumps(asdict(findings), indent=2).splitlines() if as_json else _lines(findings)
    Reporter().result(join_lines(lines))
    if not findings.can_draw:
        raise click.exceptions.Exit(1)


def _find(cache: Path | None) -> _Findings:
    """Return all facts. cache: a folder for `--cache`."""
    packages, extras = _requirements()
    with ThreadPoolExecutor() as pool:  # the probes wait for processes of their own
        opengl = pool.submit(_probe, "opengl", _opengl, purpose="splats, by OpenGL")
        ffmpeg = pool.submit(_probe, "ffmpeg", _ffmpeg)
        kernels = _probe("kernels", _kernels)
        needed = [kernels, ffmpeg.result(), *(_package(name, line) for name, line in packages.items())]
        optional = [opengl.result(), *(_extra(name, lines) for name, lines in extras.items())]
    return _Findings(
        can_draw=not any(part.problem for part in needed),
        machine=describe_machine(kernels.found),
        python=sys.executable,
        needed=needed,
        optional=optional,
        room=_room(),
        cache=None if cache is None else _cache(cache),
    )


def _probe(name: str, describe: Callable[[], str], purpose: str = "") -> _Part:
    """Return a part that is found, or fails, when a function describes it."""
    try:
        return _Part(name, describe(), purpose=purpose)
    except HsplatError as error:
        problem = ": ".join(filter(None, (error.what, error.got)))
        return _Part(name, "", problem, error.hint or "", purpose)
    except ImportError as error:  # a package is missing, or its libraries are
        return _Part(name, "", str(error), purpose=purpose)


def _kernels() -> str:
    """Describe the kernels that draw. Raises RenderError if they cannot be loaded."""
    from renderer.kernels import describe_kernels, kernels

    kernels()
    return describe_kernels()


def _opengl() -> str:
    """Describe the OpenGL that draws splats. Raises RenderError if there is none."""
    from renderer.draw import describe_opengl

    return describe_opengl()


def _ffmpeg() -> str:
    """Describe the ffmpeg that encodes films. Raises RenderError if there is none."""
    from renderer.film import describe_ffmpeg

    path, version, lacking = describe_ffmpeg()
    return f"{version} ({path})" + f", without {', '.join(lacking)}" * bool(lacking)


def _requirements() -> tuple[dict[str, str], dict[str, dict[str, str]]]:
    """Return the packages that hsplat needs, and those of each extra; each by its name, with its requirement.

    A package that only some platforms install is left out: it is OpenGL's, which is a part of its own.
    """
    needed: dict[str, str] = {}
    extras: dict[str, dict[str, str]] = {name: {} for name in EXTRAS}
    try:
        requirements = metadata.requires("hsplat") or []
    except metadata.PackageNotFoundError:  # the sources run without an installation
        return needed, {}
    for requirement in requirements:
        line, _, marker = requirement.partition(";")
        (name,) = re.findall(r"^[\w.-]+", line)
        extra = re.search(r"""extra == ["']([\w-]+)""", marker)
        if not marker:
            needed[name] = line.strip()
        elif extra and extra[1] in extras:
            extras[extra[1]][name] = line.strip()
    return needed, extras


def _package(name: str, requirement: str) -> _Part:
    """Return a package that hsplat needs."""
    version, problem = _version(name, requirement)
    return _Part(name, version, problem, f"pip install '{requirement}'" if problem else "")


def _extra(name: str, packages: dict[str, str]) -> _Part:
    """Return an extra, with the versions of its packages."""
    versions = {package: _version(package, line) for package, line in packages.items()}
    problem = ", ".join(f"{package} {problem}" for package, (_, problem) in versions.items() if problem)
    found = "" if problem else ", ".join(f"{package} {version}" for package, (version, _) in versions.items())
    return _Part(name, found, problem, install_line(name) if problem else "", EXTRAS[name])


def _version(package: str, requirement: str) -> tuple[str, str]:
    """Return the version of a package, or an empty text and the problem: it is missing, or too old."""
    version = package_versions(package)[package]
    oldest = re.search(r">=\s*([\d.]+)", requirement)
    if version == _MISSING:
        return "", version
    if oldest and _numbers(version) < _numbers(oldest[1]):
        return "", f"is {version}, older than {oldest[1]}"
    return version, ""


def _numbers(version: str) -> list[int]:
    """Return the leading numbers of a version: [2, 10] of `2.10rc1`."""
    return [int(number) for number in re.match(r"[\d.]*", version)[0].split(".") if number]  # type: ignore[index]


def _room() -> _Room:
    memory, folder = free_bytes(), tempfile.gettempdir()
    known = None if memory == float("inf") else int(memory)
    disk = shutil.disk_usage(folder).free
    return _Room(num_cores(), known, MemoryShare().num_bytes(), folder, disk, address_space_hint())


def _cache(folder: Path) -> _Cache:
    from renderer.cache import kept_bytes

    return _Cache(str(folder), folder.is_dir(), kept_bytes(folder))


def _lines(findings: _Findings) -> Iterator[str]:
    """Yield the facts as lines."""
    machine, room = findings.machine, findings.room
    yield f"hsplat {machine['versions']['hsplat']}, Python {machine['versions']['python']} ({findings.python})"
    yield f"{machine['system']}, {machine['processor']}"
    yield "films can be drawn" if findings.can_draw else "films cannot be drawn"
    yield from ("", "needed", *_part_lines(findings.needed))
    yield from ("", "optional", *_part_lines(findings.optional))
    memory = "unknown" if room.memory is None else _size(room.memory)
    rows = [
        ["processors", str(room.processors)],
        ["memory", f"{memory} free, {_size(room.bricks)} for bricks" + f"; {room.limit}" * bool(room.limit)],
        ["temporary", f"{_size(room.disk)} free in {room.temporary}"],
    ]
    if findings.cache is not None:
        kept = f"{_size(findings.cache.bytes)} kept" if findings.cache.exists else "not made yet:"
        rows.append(["cache", f"{kept} in {findings.cache.folder}"])
    else:
        rows.append(["cache", "none, unless a command has --cache FOLDER"])
    yield from ("", "room", *_indented(rows))


def _part_lines(parts: list[_Part]) -> Iterator[str]:
    """Return a line for each part, and for one with a problem a second one with the remedy."""
    rows = []
    for part in parts:
        found = part.found or f"MISSING: {part.problem}"
        rows.append([part.name, found + f" ({part.purpose})" * bool(part.purpose)])
        rows += [["", part.remedy]] * bool(part.remedy)
    return _indented(rows)


def _indented(rows: list[list[str]]) -> Iterator[str]:
    return (f"  {line}" for line in format_table(rows).splitlines())


def _size(num_bytes: int) -> str:
    return f"{num_bytes / 2**30:.1f} GiB"
