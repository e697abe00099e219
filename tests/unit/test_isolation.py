"""Readers in a child process: whatever happens there is an error of the input, and the child leaves nothing behind."""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import descriptors
import numpy as np
import pytest

import renderer
from renderer.errors import InputError, RenderError
from renderer.readers import Image, read_isolated
from renderer.volume import Label, watched_passes


def ramp(path: Path, *, host: Any) -> Image:
    values = host.allocate((3, 4, 5), np.int16)
    values[...] = np.arange(60).reshape(3, 4, 5)
    return Image(values, np.diag([1.0, 2.0, 3.0, 1.0]), (f"read {path.name}",))


def refuse(path: Path, *, host: Any) -> Image:
    raise InputError("no good", where=str(path), got="a", expected="b", hint="c")


def fail(_path: Path, *, host: Any) -> Image:
    raise ZeroDivisionError("of the library")


def crash(_path: Path, *, host: Any) -> Image:
    ctypes.string_at(0)
    raise AssertionError


def abort(_path: Path, *, host: Any) -> Image:
    os.kill(os.getpid(), signal.SIGABRT)
    raise AssertionError


def break_off(path: Path, *, host: Any) -> Image:
    """End in the middle of an answer."""
    os.write(int(sys.argv[1]), b'{"shape": [3, 4')
    return abort(path, host=host)


def crash_in_the_second_file(path: Path, *, host: Any) -> Image:
    for name in ("1", "2"):
        host.begin_file(path / name)
    return crash(path, host=host)


def loop(_path: Path, *, host: Any) -> Image:
    while True:
        pass


def fill_memory(_path: Path, *, host: Any) -> Image:
    return Image(np.ones((1, 1, 3 << 30), np.uint8), np.eye(4))


def use_the_processor(path: Path, *, host: Any) -> Image:
    """Take longer than a file of no size may, before memory is allocated."""
    end = time.process_time() + 3
    while time.process_time() < end:
        pass
    return ramp(path, host=host)


def large(_path: Path, *, host: Any) -> Image:
    return Image(host.allocate((512, 1024, 1024), np.uint8), np.eye(4))


def too_large(path: Path, *, host: Any) -> Image:
    host.require_room(1 << 62)
    return ramp(path, host=host)


def print_much(path: Path, *, host: Any) -> Image:
    os.write(1, b"out" * 100_000)
    os.write(2, b"\x1b[31mwarning" * 100_000)
    return ramp(path, host=host)


@pytest.fixture(autouse=True)
def _file(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    Path("scan.x").write_bytes(b"any")
    monkeypatch.syspath_prepend(Path(__file__).parent)  # children find the readers of this file


def read(name: str, **arguments: Any) -> Image:
    return read_isolated(f"{Path(__file__).stem}:{name}", Path("scan.x"), **arguments)


def test_voxels_come_back_in_shared_memory() -> None:
    image = read("ramp")
    np.testing.assert_array_equal(image.values, np.arange(60).reshape(3, 4, 5))
    assert image.values.dtype == np.int16 and image.values.flags.c_contiguous
    np.testing.assert_array_equal(image.world_from_index, np.diag([1.0, 2.0, 3.0, 1.0]))
    assert image.notes == ("read scan.x",)


@pytest.mark.parametrize(
    ("on_disk", "what"),
    [
        (True, "there is no room on the disk for these voxels"),
        (False, "the voxels of this file do not fit into memory"),
    ],
)
def test_voxels_without_room_are_refused(on_disk: bool, what: str) -> None:
    with pytest.raises(InputError) as error:
        read("too_large", on_disk=on_disk)
    assert error.value.what == what and error.value.got == "4294967296.0 GiB" and error.value.expected
    assert error.value.where == (tempfile.gettempdir() if on_disk else "scan.x")
    assert not on_disk or "`TMPDIR`" in str(error.value.hint)


def count(path: Path, *, host: Any) -> Image:
    for number in range(4):
        host.tell_progress(number, 3, "level 2")
    return ramp(path, host=host)


def test_the_progress_is_told_and_is_no_answer() -> None:
    told = list[tuple[int, int, str]]()
    with watched_passes(lambda *each: told.append(each)):
        assert read("count").values.shape == (3, 4, 5)
    assert told == [(number, 3, "level 2") for number in range(4)]


LABELS = (Label(3, "Größe 数据", (0.25, 0.5, 1.0), 0.5), Label(90))


def with_labels(path: Path, *, host: Any) -> Image:
    return replace(ramp(path, host=host), labels=(*LABELS, Label(91, "", (2.0, 0.0, 0.0), 7.0)))


def test_labels_come_back() -> None:
    """A colour or an opacity that is none is left out."""
    assert read("with_labels").labels == (*LABELS, Label(91))


def test_errors_of_the_input_come_back_as_they_are() -> None:
    with pytest.raises(InputError) as error:
        read("refuse")
    assert str(error.value) == "scan.x: no good\n  got: a\n  expected: b\n  hint: c"


@pytest.mark.parametrize(
    ("name", "what", "got"),
    [
        ("fail", "this file cannot be decoded", None),
        ("fill_memory", "this file cannot be decoded", "more memory than is allowed"),
        ("crash", "reading this file ended the process that decodes it", "signal SIGSEGV"),
        ("abort", "reading this file ended the process that decodes it", "signal SIGABRT"),
        ("break_off", "reading this file ended the process that decodes it", "signal SIGABRT"),
        ("loop", "reading this file ended the process that decodes it", "signal SIGXCPU"),
    ],
)
def test_all_else_is_an_error_of_the_input(name: str, what: str, got: str | None, monkeypatch) -> None:
    monkeypatch.setattr("renderer.readers.isolation._SECONDS", 2)
    with pytest.raises(InputError) as error:
        read(name)
    assert (error.value.what, error.value.where, error.value.got) == (what, "scan.x", got)
    assert not Path("core").exists()


def test_the_file_that_ends_the_process_is_named() -> None:
    with pytest.raises(InputError) as error:
        read("crash_in_the_second_file")
    assert error.value.where == "scan.x/2"


def test_nothing_is_printed(capfd: pytest.CaptureFixture[str]) -> None:
    read("print_much")
    assert capfd.readouterr() == ("", "")


@pytest.mark.slow
def test_large_files_have_time_to_be_parsed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("renderer.readers.isolation._SECONDS", 2)
    Path("scan.x").write_bytes(bytes(32 << 20))
    assert read("use_the_processor").values.shape == (3, 4, 5)


@pytest.mark.slow
def test_sparse_files_have_no_more_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("renderer.readers.isolation._SECONDS", 2)
    os.truncate("scan.x", 32 << 20)
    with pytest.raises(InputError, match="ended the process"):
        read("use_the_processor")


@pytest.mark.parametrize("executable", ["", None, "/no/python"])
def test_a_process_that_cannot_start_is_no_fault_of_the_file(executable: str | None, monkeypatch) -> None:
    monkeypatch.setattr(sys, "executable", executable)
    with pytest.raises(RenderError) as error:
        read("ramp")
    assert (error.value.what, error.value.where) == ("the process that decodes this file cannot be started", "scan.x")


def test_a_process_that_ends_before_it_reads_is_no_fault_of_the_file(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "executable", "/bin/false")
    with pytest.raises(RenderError) as error:
        read("ramp")
    assert error.value.got == "exit status 1"


def test_the_current_folder_may_change(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A notebook finds its modules in the current folder at its start."""
    root = str(Path(renderer.__file__).parents[1])
    monkeypatch.setattr(sys, "path", ["", *(each for each in sys.path if each != root)])
    Path("renderer.py").write_text("raise AssertionError")
    assert read("ramp").values.shape == (3, 4, 5)


_IN_ANOTHER = """
import os, resource, sys
sys.path[:0] = {folders}
from pathlib import Path
from renderer.readers import read_isolated
{before}
values = read_isolated("test_isolation:{reader}", Path("scan.x")).values
sys.exit(0 if values.size else 3)
"""


@pytest.mark.parametrize(
    ("before", "reader"),
    [
        ("os.closerange(0, 3)", "ramp"),
        ("resource.setrlimit(resource.RLIMIT_CPU, (30, 30))", "large"),
        ("resource.setrlimit(resource.RLIMIT_AS, (2 << 30, 2 << 30))", "large"),
    ],
    ids=["closed", "processor", "memory"],
)
def test_other_surroundings(before: str, reader: str) -> None:
    """Without standard streams, and under limits of the system."""
    folders = [str(Path(file).parent) for file in (__file__, descriptors.__file__, renderer.__path__[0])]
    program = _IN_ANOTHER.format(folders=folders, before=before, reader=reader)
    assert subprocess.run([sys.executable, "-c", program], check=False, timeout=60).returncode == 0


def test_descriptors_are_closed() -> None:
    before = descriptors.open_unnamed()
    for name in ("ramp", "crash"):
        with contextlib.suppress(InputError):
            read(name)
    assert descriptors.open_unnamed() <= before
