"""Kernels take what their header says and nothing else, and come from the library that was built, or from none."""

from __future__ import annotations

import hashlib
import re
import shutil
import struct as struct_module
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from commands import hsplat, python
from kernel_records import RECORDS, SIGNATURES, records, signatures

import renderer.kernels
from renderer.errors import RenderError
from renderer.kernels import (
    BUILT,
    LEVELS,
    SOURCES,
    Header,
    kernels,
    load_library,
    num_lanes,
    processor_level,
    read_headers,
    this_target,
)

MANIFEST = "libraries.txt"

HEADER = read_headers(SOURCES)
WINDOWS = np.array([[0, 0, 2, 1]])


def bin_one(**changes: Any) -> tuple[list[int], list[int]]:
    """Sort one brick, over the first row, into a grid of 2 x 2 tiles."""
    starts, numbers = np.zeros(6, np.int64), np.full(2, -1)
    tiles = {"tile_windows": WINDOWS, "have_rays": np.ones((2, 2), np.bool_)}
    arguments = tiles | {"starts": starts, "numbers": numbers}
    kernels().bin_bricks(**arguments | changes)
    return starts.tolist(), numbers.tolist()


def test_records_and_signatures_are_made_from_the_headers() -> None:
    assert RECORDS.read_text("ascii") == records(), "python tests/support/kernel_records.py writes it"
    assert SIGNATURES.read_text("ascii") == signatures(), "python tests/support/kernel_records.py writes it"


def test_the_door_offers_all_records() -> None:
    names = re.findall(r"^class (\w+)\(NamedTuple\)", records(), re.MULTILINE)
    assert names
    assert set(names) <= set(renderer.kernels.__all__)


@pytest.mark.parametrize("name", HEADER.arguments)
def test_python_lays_structs_out_as_the_compiler_does(name: str) -> None:
    assert getattr(kernels(), name)  # compares sizes


class Inner(NamedTuple):
    a: bool
    b: float


class Outer(NamedTuple):
    c: list[Inner]


def test_structs_lie_one_behind_the_other() -> None:
    inner, outer = (
        "struct Inner {\n    bool a;\n    double b;\n};\n",
        "struct Outer {\n    Array<const Inner, 1> c;\n};\nKERNEL(f, Outer)\n",
    )
    struct = Header(inner + outer)
    numbers: list[Any] = []
    kept: list[Any] = []
    struct.struct_of("f").add(Outer([Inner(True, 0.5), Inner(False, -2.0)]), numbers, kept)
    assert numbers == [kept[-1].ctypes.data, 2]
    assert kept[-1].tobytes() == struct_module.pack("=?7xd?7xd", True, 0.5, False, -2.0)


def test_a_kernel_fills_arrays() -> None:
    assert bin_one() == ([0, 1, 2, 2, 2, 2], [0, 0])


def test_arrays_may_lie_at_any_address() -> None:
    windows = np.frombuffer(b" " + WINDOWS.tobytes(), WINDOWS.dtype, offset=1).reshape(WINDOWS.shape)
    assert not windows.flags.aligned
    assert bin_one(tile_windows=windows) == bin_one()


@pytest.mark.parametrize(
    ("changes", "error", "words"),
    [
        ({"tile_windows": WINDOWS.astype(float)}, TypeError, r"tile_windows: float64 \[2\], expected int64 \[2\]"),
        ({"tile_windows": WINDOWS[0]}, TypeError, r"tile_windows: int64 \[1\], expected int64 \[2\]"),
        ({"tile_windows": np.zeros((1, 3), np.int64)}, ValueError, r"tile_windows: shape \(1, 3\), expected"),
        ({"tile_windows": WINDOWS.tolist()}, TypeError, "tile_windows: list, expected an array"),
        ({"tile_windows": np.tile(WINDOWS, 2)[:, ::2]}, ValueError, "tile_windows: not contiguous"),
        ({"starts": np.broadcast_to(np.int64(0), 6)}, ValueError, "starts: not contiguous"),
        ({"have_rays": 2.5}, TypeError, "have_rays"),
        ({"have_rays": None}, TypeError, "have_rays"),
        ({"tile_windows": WINDOWS + 1}, IndexError, "bin_bricks"),
        ({"number_of_rows": 2}, TypeError, "no argument number_of_rows"),
        ({"starts": np.zeros(5, np.int64)}, IndexError, "bin_bricks"),
        ({"numbers": np.zeros(1, np.int64)}, IndexError, "bin_bricks"),
    ],
)
def test_wrong_arguments_are_refused(changes: dict[str, Any], error: type[Exception], words: str) -> None:
    with pytest.raises(error, match=words):
        bin_one(**changes)


def test_a_read_only_array_is_refused_where_the_kernel_writes() -> None:
    starts = np.zeros(6, np.int64)
    starts.setflags(write=False)
    with pytest.raises(ValueError, match="read-only"):
        bin_one(starts=starts)


def test_missing_arguments_are_named() -> None:
    with pytest.raises(TypeError, match="bin_bricks: no starts"):
        kernels().bin_bricks.partial(tile_windows=WINDOWS, have_rays=np.ones((2, 2), np.bool_))(
            numbers=np.zeros(2, np.int64)
        )


@pytest.fixture
def built(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a copy of the libraries, which are loaded from there."""
    folder = tmp_path / "built"
    shutil.copytree(BUILT, folder)
    monkeypatch.setattr("renderer.kernels.library.BUILT", folder)
    return folder


def test_without_kernels_of_the_highest_level_a_lower_one_draws(built: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("HSPLAT_PROCESSOR_LEVEL", raising=False)
    text = (built / MANIFEST).read_text("ascii")
    level = processor_level.__wrapped__()
    lowest = min(LEVELS[this_target().partition("-")[2]])
    (built / MANIFEST).write_text(text + f"0 kernels-{lowest}.so\n0 kernels-9.so\n", "ascii")
    assert processor_level.__wrapped__() == level
    others = [line for line in text.splitlines() if "kernels-" not in line]
    (built / MANIFEST).write_text("\n".join([*others, f"0 kernels-{lowest}.so"]), "ascii")
    assert processor_level.__wrapped__() == lowest


def _edit(change: Callable[[bytes], bytes]) -> Callable[[Path], object]:
    return lambda path: path.write_bytes(change(path.read_bytes()))


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (Path.unlink, "cannot be read (No such file or directory)"),
        (_edit(lambda data: data[: len(data) // 2]), "are damaged"),
        (_edit(lambda data: bytes(len(data))), "are damaged"),
        (_edit(lambda _: b""), "are damaged"),
        (lambda path: (path.parent / MANIFEST).write_text("0" * 32 + "\n"), "are of other sources than these"),
        (lambda path: (path.parent / MANIFEST).write_bytes(b"\xff\n"), "cannot be read"),
        (lambda path: (path.parent / MANIFEST).unlink(), "cannot be read (No such file or directory)"),
    ],
)
def test_a_library_that_is_not_what_was_built_is_not_loaded(
    built: Path, damage: Callable[[Path], object], words: str
) -> None:
    path = built / f"kernels-{processor_level()}.so"
    damage(path)
    with pytest.raises(RenderError, match=re.escape(words)) as caught:
        load_library()
    assert str(path) in str(caught.value)
    assert re.search("`(python -m renderer.kernels.build|pip install .*)` makes them again", str(caught.value))


def test_a_library_of_another_machine_is_refused(built: Path) -> None:
    path = built / f"kernels-{processor_level()}.so"
    data = bytearray(path.read_bytes())
    data[18] ^= 0xFF  # the machine, in a header of ELF
    path.write_bytes(data)
    text = (built / MANIFEST).read_text("ascii")
    names = hashlib.blake2b(bytes(data), digest_size=16).hexdigest()
    (built / MANIFEST).write_text(re.sub(rf"\w+ {path.name}", f"{names} {path.name}", text))
    with pytest.raises(RenderError, match="cannot be read"):
        load_library()


def test_the_environment_asks_for_a_lower_level() -> None:
    program = "from renderer.kernels import num_lanes, processor_level; print(processor_level(), num_lanes())"
    levels = LEVELS[this_target().partition("-")[2]]
    for level in sorted(levels):
        if level <= processor_level():
            assert python("-c", program, HSPLAT_PROCESSOR_LEVEL=str(level)).stdout == f"{level} {levels[level][1]}\n"
    assert num_lanes() in (4, 8, 16)
    got = hsplat("--version", "--verbose", HSPLAT_PROCESSOR_LEVEL="9")
    assert got.returncode == 2
    assert got.stderr.startswith("HSPLAT_PROCESSOR_LEVEL: this processor has no such level\n  got: 9\n")
