"""One volume file to its verdict: the voxels of the undamaged file, others where nothing guards them, or a clear error.

Each file is read in a fork of this process, with limits, so that a crash, a loop or a flood of memory ends the fork
alone and is measured. Formats that the program reads in a child process are mostly read in the fork itself, which is
quicker; where that ends badly, the program's own way decides.
"""

from __future__ import annotations

import ctypes
import faulthandler
import json
import os
import resource
import signal
import tempfile
import traceback
import warnings
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from this_process import read_here
from volume_bases import Base, make_bases, real_data
from volume_damage import Case, Sparse, is_within_checksums, make_bomb, make_case, write_case

from renderer.errors import InputError
from renderer.job import volume_files
from renderer.readers import Image, read_isolated, read_volume
from renderer.scene import FileSource, VolumeSpec
from renderer.system import describe_exit
from renderer.volume import Array, Bools, Volume

# What reading may take: processor time, and memory beside the voxels and this process. A child process, which has the
# same limits, is started first, and its libraries are loaded.
MAX_SECONDS = 10
MAX_BYTES = 2**30
_CHILD_SECONDS, _CHILD_BYTES = 3, 2**28
# What a fork takes of its own while it waits for a child process.
_FORK_BYTES = 2**26
_FEW_SECONDS = 3
_NUM_COPIES = 4
# A fork that waits instead of working ends after this many seconds; one that takes as much memory gets no more.
_PATIENCE_S = 60
_ADDRESS_SPACE = 6 * 2**30
MAX_LINE = 400
# Larger volumes are not compared, voxel by voxel, with undamaged ones, which are small.
_MAX_COMPARED = 2**26


@dataclass
class Verdict:
    """The outcome: `same` voxels, `other` ones, `refused`, or `wrong`, which no file may have.

    why: what is wrong, or the message. seconds: of the processor. num_bytes: the most memory beside this process.
    """

    index: int
    base: str
    damage: str
    outcome: str
    why: str = ""
    seconds: float = 0.0
    num_bytes: int = 0
    in_child: bool = False

    @property
    def case(self) -> str:
        return f"{self.base}, {self.damage}"


@dataclass
class _Result:
    """The end of a fork: its exit status, its time and memory, and its findings until then."""

    status: int
    seconds: float
    num_bytes: int
    in_child: bool
    found: dict[str, Any] = field(default_factory=dict)


def judge_number(seed: int, index: int, folder: Path) -> Verdict:
    """Judge one volume in a folder, with real volumes among the undamaged ones if there are any."""
    return judge_volume(make_case(make_bases(real_data()), seed, index), folder, index)


def judge_bomb(name: str) -> Verdict:
    """Judge a small file that asks for much, by its format and its name among the bombs of this format."""
    form, _, bomb = name.partition("_")
    base = next(base for base in make_bases(None) if base.form == form)
    with tempfile.TemporaryDirectory(prefix="hsplat-fuzz-") as folder:
        return judge_volume(make_bomb(base, bomb), Path(folder, "case"))


def judge_volume(case: Case, folder: Path, index: int = 0) -> Verdict:
    """Write the files of a case into a folder, and read them there."""
    verdict = Verdict(index, case.base.name, case.damage, "wrong")
    folder.mkdir(exist_ok=True)
    path = write_case(case, folder)
    result = _read_in_fork(case, folder, path, in_child=case.in_child)
    if result.found.get("is_foreign") and _fault(case, folder, result):
        result = _read_in_fork(case, folder, path, in_child=True)
    verdict.in_child = result.in_child
    verdict.seconds, verdict.num_bytes = result.seconds, result.num_bytes
    fault = _fault(case, folder, result)
    if fault is None:
        verdict.outcome, verdict.why = result.found["outcome"], result.found.get("text", "")
    else:
        verdict.why = fault
    return verdict


def _fault(case: Case, folder: Path, result: _Result) -> str | None:
    """Return what is wrong with the outcome; None if nothing is."""
    found = result.found
    more_seconds, more_bytes = (_CHILD_SECONDS, _CHILD_BYTES) if result.in_child else (0, 0)
    num_voxel_bytes = found.get("num_bytes", 0)
    if result.status != 0:
        return f"reading ended with {describe_exit(result.status)} after {result.seconds:.1f} s, and {found}"
    if result.seconds > MAX_SECONDS + more_seconds:
        return f"{result.seconds:.1f} s of processor time"
    if result.num_bytes > MAX_BYTES + more_bytes + _NUM_COPIES * max(num_voxel_bytes, _num_file_bytes(case)):
        return f"{result.num_bytes >> 20} MiB of memory, for {num_voxel_bytes >> 20} MiB of voxels"
    if found.get("printed"):
        return f"printed {found['printed']!r}"
    if "escaped" in found:
        return str(found["escaped"])
    if found["outcome"] == "refused":
        fault = _fault_of_message(found["text"], found["where"], folder)
        return fault or ("refused what is not damaged: " + found["text"] if case.damage == "unchanged" else None)
    return _fault_of_voxels(case, found)


def _num_file_bytes(case: Case) -> int:
    """Return the bytes of the largest file, which the program takes for the size of a volume; 0 unless it is large."""
    return max((each.num_bytes for each in case.files.values() if isinstance(each, Sparse)), default=0)


def _fault_of_voxels(case: Case, found: dict[str, Any]) -> str | None:
    """Return why a volume must not have been read that is not the undamaged one; None if it may have been."""
    if found["outcome"] == "same":
        return None
    if case.damage == "unchanged":
        return f"other voxels of a file that is not damaged: {found['shown']}"
    if case.num_lost and not (case.base.is_text and found["differs_at_end"]):
        return f"other voxels of a file without its last {case.num_lost} bytes: {found['shown']}"
    if is_within_checksums(case) and not case.damage.startswith("bomb"):
        return f"other voxels where a checksum does not hold: {found['shown']}"
    if _is_one_stream(case) and found["num_left"] >= found["num_bytes"] // max(found["shape"]):
        return f"{found['num_left']} bytes of the stream are left over: {found['shown']}"
    return None


def _is_one_stream(case: Case) -> bool:
    """Return whether all voxels are in one compressed stream, of which a damaged header cannot leave a part out."""
    is_alone = case.base.form in ("nrrd", "metaimage") and "list" not in case.base.name and not case.base.choice
    return is_alone and bool(case.base.guarded) and not case.damage.startswith("bomb")


def _fault_of_message(text: str, where: str | None, folder: Path) -> str | None:
    """Return what is wrong with the text of an error; None if nothing is."""
    if where is None or not where.startswith(str(folder)):
        return f"an error that names {where} and not its file: {text}"
    for line in text.replace(str(folder), "").split("\n"):
        if len(line) > MAX_LINE:
            return f"a line of {len(line)} characters: {line[:MAX_LINE]}"
        if not line.isprintable():
            return f"a line that is not printable: {line!r}"
    return None


def _read_in_fork(case: Case, folder: Path, path: Path, *, in_child: bool) -> _Result:
    """Read a volume in a fork of this process."""
    undamaged = undamaged_volume(case.base)
    baseline = _baseline()
    receiver, sender = os.pipe()
    pid = os.fork()
    if pid == 0:
        try:
            os.close(receiver)
            faulthandler.disable()
            ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # when this process ends
            signal.signal(signal.SIGALRM, signal.SIG_DFL)
            signal.alarm(_PATIENCE_S)
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
            _limit(MAX_SECONDS + _CHILD_SECONDS, _ADDRESS_SPACE)
            _answer(sender, case, path, undamaged, in_child=in_child)
        finally:
            os._exit(0)
    os.close(sender)
    with open(receiver, "rb") as answers:
        lines = answers.read().splitlines()
    _, status, usage = os.wait4(pid, 0)
    found = {key: value for line in lines for key, value in json.loads(line).items()}
    is_apart = in_child and "is_foreign" in found
    num_bytes = max(0, 1024 * usage.ru_maxrss - baseline)
    if is_apart and num_bytes > _FORK_BYTES:  # the child process, which has nothing of this one; a fork shares it all
        num_bytes += baseline
    seconds = usage.ru_utime + usage.ru_stime
    return _Result(os.waitstatus_to_exitcode(status), seconds, num_bytes, is_apart, found)


def _limit(seconds: int, num_bytes: int) -> None:
    """Limit processor time, and memory beside what this process has."""
    taken = int(Path("/proc/self/statm").read_text("ascii").split()[0]) * resource.getpagesize()
    for kind, limit in ((resource.RLIMIT_CPU, seconds), (resource.RLIMIT_AS, taken + num_bytes)):
        resource.setrlimit(kind, (limit, resource.getrlimit(kind)[1]))


def _answer(sender: int, case: Case, path: Path, undamaged: Volume, *, in_child: bool) -> None:
    """Read a volume, and write what became of it into a pipe, a line of JSON for each finding."""

    def tell(**found: Any) -> None:
        os.write(sender, json.dumps(found).encode("ascii") + b"\n")

    def read_foreign(reader: str, path: Path, **arguments: Any) -> Image:
        tell(is_foreign=True)
        if in_child:
            return read_isolated(reader, path, **arguments)
        _limit(_FEW_SECONDS, MAX_BYTES)  # what needs more is read again in a child process
        return read_here(reader, path, **arguments)

    patched = pytest.MonkeyPatch()  # for good: this process ends with its answer
    patched.setattr("renderer.readers.volume_reading.read_isolated", read_foreign)
    warnings.resetwarnings()  # as they are outside of tests
    warnings.simplefilter("ignore", DeprecationWarning)
    warnings.showwarning = lambda message, *_: os.write(2, f"{message}\n".encode())
    with tempfile.TemporaryFile() as printed:
        for stream in (1, 2):
            os.dup2(printed.fileno(), stream)
        try:
            try:
                tell(**_compared(read_volume(_spec(case.base, path)), undamaged))
            except InputError as error:
                tell(outcome="refused", text=str(error), where=error.where)
            list(volume_files(_spec(case.base, path)))  # which must not become the output
        except BaseException:
            tell(escaped=traceback.format_exc(limit=-6))
        printed.seek(0)
        is_isolated = case.base.form in (
            "tiff",
            "dicom",
            "vtk",
            "hdf5",
            "pictures",
            "store",
        )  # libraries, in their own process
        may_print = is_isolated and not in_child
        tell(printed="" if may_print else printed.read(300).decode("utf-8", "replace"))


def _compared(volume: Volume, undamaged: Volume) -> dict[str, Any]:
    """Return how a volume compares with the undamaged one."""
    values, expected = volume.values, undamaged.values
    is_alike = values.dtype == expected.dtype and values.shape == expected.shape
    is_same = is_alike and np.array_equal(volume.world_from_index, undamaged.world_from_index)
    num_other = int(np.count_nonzero(_differ(values, expected))) if is_alike and values.nbytes <= _MAX_COMPARED else -1
    last = (-1, -1, -1)
    return {
        "num_left": expected.nbytes - values.nbytes,
        "shape": values.shape,
        "outcome": "same" if is_same and num_other == 0 else "other",
        "num_bytes": values.nbytes,
        "differs_at_end": bool(is_same) and num_other == 1 and bool(values[last] != expected[last]),
        "shown": f"{num_other} of {values.size} voxels, {values.dtype} {values.shape}, not {expected.dtype} "
        f"{expected.shape}",
    }


def _differ(values: Array, expected: Array) -> Bools:
    """Return where values are other than expected; voxels without data are the same."""
    return np.asarray((values != expected) & ~(np.isnan(values) & np.isnan(expected)))


@cache
def undamaged_volume(base: Base) -> Volume:
    """Return the volume of undamaged files, which are read in this process; raises AssertionError for wrong ones."""
    with tempfile.TemporaryDirectory(prefix="hsplat-fuzz-") as name, pytest.MonkeyPatch.context() as patched:
        patched.setattr("renderer.readers.volume_reading.read_isolated", read_here)
        path = write_case(Case(base, "unchanged", dict(base.files), base.opened), Path(name))
        volume = read_volume(_spec(base, path))
        assert base.values is None or not _differ(volume.values, base.values).any(), base.name
        assert base.values is None or volume.values.dtype == base.values.dtype, base.name
        return volume


def _spec(base: Base, path: Path) -> VolumeSpec:
    return VolumeSpec(base.source(path.parent) or FileSource(path), **base.choice)


def _baseline() -> int:
    """Return the peak memory of a fork that does nothing, now: this process may have grown."""
    pid = os.fork()
    if pid == 0:
        os._exit(0)
    return 1024 * os.wait4(pid, 0)[2].ru_maxrss
