"""A short run of `tests/fuzz/run_volumes.py`, from another seed than its own, and faults that its judge must see."""

from __future__ import annotations

import multiprocessing
import os
import signal
import time
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import judge_volumes
import numpy as np
import pytest
from fuzzing import judge_apart
from judge_volumes import judge_bomb, judge_number, judge_volume
from volume_bases import Base, make_bases
from volume_damage import Case

from renderer.errors import InputError
from renderer.readers import read_nrrd

SEED = 5
NUMBERS = range(1, 120, 2)  # every other one of the undamaged volumes, which take turns
FORMATS = {"nrrd", "metaimage", "nifti", "mgh", "npy", "npz", "raw", "cube", "tiff", "dicom", "vtk"}
FORMATS |= {"mrc", "hdf5", "pictures", "store"}

# Small files by which readers once worked, waited or took memory without end, or failed.
MENDED = (
    *("nrrd_gzip_inflates_before_its_voxels", "nrrd_bzip2_inflates_before_its_voxels", "nrrd_gzip_of_no_bytes"),
    *("nrrd_origins", "nrrd_blanks_in_a_name", "nrrd_numbered_files", "metaimage_continued_lines"),
    *("nifti_extension_of_gigabytes", "nifti_extension_of_a_pair", "nifti_name_in_gzip", "nifti_many_extensions"),
    *("nrrd_digits_in_a_number", "nifti_blanks_in_a_name", "vtk_empty_lines_in_a_legacy_header"),
    *("npy_long_shape", "npz_claims_gigabytes", "tiff_deflate_inflates", "dicom_many_series", "vtk_legacy_long_type"),
)


@pytest.fixture(scope="module")
def pool() -> Iterator[ProcessPoolExecutor]:
    """A process without threads, which is forked for each file."""
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as opened:
        yield opened


def test_damaged_volumes_do_no_harm(pool: ProcessPoolExecutor) -> None:
    verdicts = list(pool.map(partial(judge_apart, judge_number, SEED), NUMBERS, chunksize=25))
    assert [f"{v.index}, {v.case}: {v.why}" for v in verdicts if v.outcome == "wrong"] == []
    assert {verdict.base.split()[0] for verdict in verdicts} == FORMATS
    for outcome in ("same", "other", "refused"):
        assert sum(verdict.outcome == outcome for verdict in verdicts) > len(NUMBERS) / 20
    assert 0 < sum(verdict.in_child for verdict in verdicts) < len(NUMBERS) / 5


def test_bombs_do_no_harm(pool: ProcessPoolExecutor) -> None:
    verdicts = list(pool.map(judge_bomb, MENDED))
    assert {verdict.damage: verdict.why for verdict in verdicts if verdict.outcome == "wrong"} == {}


@pytest.fixture(scope="module")
def base() -> Base:
    return base_of("nrrd gzip attached")


def base_of(name: str) -> Base:
    return next(base for base in make_bases(None) if base.name == name)


def unchanged(base: Base) -> Case:
    return Case(base, "unchanged", dict(base.files), base.opened)


def altered(base: Base, damage: str, change: Callable[[bytes], bytes], num_lost: int = 0) -> Case:
    data = base.files[base.opened]
    return Case(base, damage, {base.opened: change(data)}, base.opened, num_lost=num_lost)


def crash(path: Path, *_: Any) -> Any:
    os.kill(os.getpid(), signal.SIGSEGV)


def fail(path: Path, *_: Any) -> Any:
    return {}["a"]


def loop(path: Path, *_: Any) -> Any:
    while True:
        pass


def wait(path: Path, *_: Any) -> Any:
    time.sleep(60)


def fill_memory(path: Path, *_: Any) -> Any:
    return np.ones(2**28, np.uint8)[:1]


def warn(path: Path, *_: Any) -> Any:
    warnings.warn("a warning of numpy", RuntimeWarning, stacklevel=1)
    raise InputError("no good", where=str(path))


def refuse_at_length(path: Path, *_: Any) -> Any:
    raise InputError("no good", where=str(path), got="x" * 500)


def refuse_another_file(path: Path, *_: Any) -> Any:
    raise InputError("no good", where="another")


def refuse(path: Path, *_: Any) -> Any:
    raise InputError("no good", where=str(path))


@pytest.mark.parametrize(
    ("fault", "why"),
    [
        *((crash, "signal SIGSEGV"), (fail, "KeyError: 'a'"), (fill_memory, "MiB of memory")),
        pytest.param(loop, "signal SIGXCPU", marks=pytest.mark.slow),
        pytest.param(wait, "signal SIGALRM", marks=pytest.mark.slow),
        *((warn, "a warning of numpy"), (refuse_at_length, "a line of 507 characters")),
        *((refuse_another_file, "names another and not its file"), (refuse, "refused what is not damaged")),
    ],
)  # fmt: skip
def test_faults_are_seen(tmp_path, monkeypatch, base: Base, fault: Callable[..., Any], why: str) -> None:
    for name, limit in (("MAX_SECONDS", 1), ("_CHILD_SECONDS", 0), ("_PATIENCE_S", 3), ("MAX_BYTES", 2**26)):
        monkeypatch.setattr(judge_volumes, name, limit)
    assert judge_volume(unchanged(base), tmp_path / "right").outcome == "same"
    monkeypatch.setattr("renderer.readers.nrrd.read_nrrd", fault)
    if fault is wait:
        monkeypatch.setattr(judge_volumes, "_PATIENCE_S", 1)
    verdict = judge_volume(unchanged(base), tmp_path / "wrong")
    assert verdict.outcome == "wrong" and why in verdict.why


def test_other_voxels_are_seen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, base: Base) -> None:
    """Whatever was damaged, one voxel is another: that may be where only a header was, or no checksum is."""
    begin, end = base.guarded[base.opened][0]
    plain = base_of("nrrd raw attached")

    def flip(place: int) -> Callable[[bytes], bytes]:
        return lambda data: data[:place] + bytes([data[place] ^ 1]) + data[place + 1 :]

    cases = {
        "other voxels of a file that is not damaged": unchanged(base),
        "other voxels of a file without its last 5 bytes": altered(base, "", lambda data: data[:-5], num_lost=5),
        "other voxels where a checksum does not hold": altered(base, "", flip(end - 20)),
        "": altered(base, "", flip(begin - 20)),
        " ": altered(plain, "", flip(len(plain.files[plain.opened]) - 20)),
    }
    undamaged = {each: judge_volumes.undamaged_volume(each).values for each in (base, plain)}

    def alter(path: Path, *arguments: Any) -> Any:
        own = base if path.parent.name != "4" else plain
        path.write_bytes(own.files[own.opened])
        values = undamaged[own].copy()
        values[1, 1, 1] += 1
        return replace(read_nrrd(path, *arguments), values=values)

    monkeypatch.setattr("renderer.readers.nrrd.read_nrrd", alter)
    for number, (why, case) in enumerate(cases.items()):
        verdict = judge_volume(case, tmp_path / str(number))
        assert verdict.outcome == ("wrong" if why.strip() else "other")
        assert verdict.why.startswith(why.strip())


def test_what_is_left_over_of_a_stream_is_seen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, base: Base) -> None:

    def leave_out(path: Path, *arguments: Any) -> Any:
        path.write_bytes(base.files[base.opened])
        image = read_nrrd(path, *arguments)
        return replace(image, values=image.values[1:])

    monkeypatch.setattr("renderer.readers.nrrd.read_nrrd", leave_out)
    case = altered(base, "", lambda data: data.replace(b"10 12 4", b"10 12 3"))
    assert judge_volume(case, tmp_path / "a").why.startswith("240 bytes of the stream are left over")


def test_crashes_of_libraries_are_left_to_their_process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file that ends the fork is read again as by the program: in another process, where it does not crash."""
    image = base_of("vtk ascii none")
    judge_volumes.undamaged_volume(image)
    monkeypatch.setattr("renderer.readers.vtk_image.read_vtk", lambda path, **_: crash(path))
    verdict = judge_volume(unchanged(image), tmp_path / "a")
    assert (verdict.outcome, verdict.in_child) == ("same", True)
