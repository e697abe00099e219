"""Lock an output, so that only one job at a time writes it, in this process or another.

A lock ends with its process, even if that is killed.
"""

from __future__ import annotations

import contextlib
import os
import re
import stat
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from renderer.errors import InputError, OutputLockedError
from renderer.film.atomic import remove_temporaries, require_writable, sync_to_disk, translate_os_errors
from renderer.film.names import frame_path, unfinished_folder
from renderer.film.runs import consecutive_ranges
from renderer.scene import OutputSpec, place_of
from renderer.system import is_path_of, lock_bytes, unlock_bytes

# The name of the lock file in a folder for unfinished work.
_LOCK_FILE = "lock"
# The content of a lock file: the process and the machine of the job that wrote it.
_OWNER_PATTERN = re.compile(rb"process [0-9]+ on .+", re.DOTALL)
# The largest number of bytes that are read of a lock file's content.
_MAX_OWNER_BYTES = 200
# The position of the byte in a lock file that is the gate. A job locks this byte while it locks or unlocks its slots,
# so that no job is refused because another job is just leaving.
_GATE_BYTE = 0
# The position of the byte in a lock file that is slot 0, the lock of frame 0. Each further slot is the next byte.
_FIRST_SLOT_BYTE = 1


@contextlib.contextmanager
def locked_output(output: OutputSpec, frames: Sequence[int], sidecar: Path) -> Iterator[Path]:
    """Lock all files of an output that show any of the frames; yield the folder for unfinished work of the first file.

    After the block, folders for unfinished work are removed if they are empty. Raises OutputLockedError if another job
    is writing one of the files; InputError or RenderError if a file cannot be written.
    """
    slots, names = defaultdict[Path, set[int]](set), dict[Path, Path]()
    for each in output.shown(frames):
        folder = unfinished_folder(each)  # two templates of numbered files may share this folder
        slots[folder].update(filter(each.shows, frames) if each.is_numbered else [0])
        names.setdefault(folder, each.file)
    with contextlib.ExitStack() as stack:
        # All jobs lock folders in the same order, so that one of two jobs with the same files gets all of them.
        for folder in sorted(slots, key=place_of):
            stack.enter_context(lock_slots(folder, sorted(slots[folder]), names[folder]))
        for each in output.shown(frames):
            require_writable(frame_path(each.file, frames[0]), unfinished_folder(each))
        require_writable(sidecar, unfinished_folder(output))
        yield unfinished_folder(output)


@contextlib.contextmanager
def locked_files(files: Iterable[Path]) -> Iterator[None]:
    """Lock files that have no folder for unfinished work, each by a hidden lock file beside it.

    Missing folders are made, and removed at the end if they are still empty. Raises OutputLockedError if another job
    has locked one of the files, and InputError or RenderError as `lock_slots` does.
    """
    files = sorted(files, key=place_of)
    made = dict.fromkeys(each for file in files for each in file.parents if not os.path.lexists(each))
    try:
        with contextlib.ExitStack() as stack:
            for file in files:
                stack.enter_context(lock_slots(file.parent, [0], file, shared_file=f".{file.name}.lock"))
            yield
    finally:
        for folder in made:
            with contextlib.suppress(OSError):  # the folder may not be empty
                folder.rmdir()


@contextlib.contextmanager
def lock_slots(folder: Path, slots: Sequence[int], output: Path, *, shared_file: str | None = None) -> Iterator[None]:
    """Lock slots of a folder for unfinished work until the end of the block. A missing folder is made.

    slots: ascending numbers. Each stands for a frame; a film in one file has slot 0 alone. Jobs without a common slot
    do not exclude each other. The last job to leave removes the temporary files of killed jobs, and the folder if it is
    empty; otherwise the lock file stays and shows that hsplat made the folder. On a file system without locks, no job
    is excluded.

    output: the name of the output, for messages. shared_file: the name of the lock file, for a folder that also holds
    other files, which stay. Raises OutputLockedError if another job holds one of the slots; InputError if something
    else has the name of the folder or the lock file, RenderError if the folder cannot be made.
    """
    file = folder / (shared_file or _LOCK_FILE)
    with translate_os_errors(output):
        descriptor = _acquire_gate(file, owns_folder=shared_file is None)
    try:
        with translate_os_errors(output):
            _acquire_slots(descriptor, slots, output)
        yield
    finally:
        _release_slots(file, descriptor, owns_folder=shared_file is None)


def require_own_folder(folder: Path) -> None:
    """Raise InputError if the path of a folder for unfinished work is taken by anything that no job has made.

    A folder that a job has made is empty, or has a job's lock file. Raises OSError.
    """
    with contextlib.suppress(FileNotFoundError):
        mode = folder.lstat().st_mode
        got = "a link" if stat.S_ISLNK(mode) else "a file"
        if stat.S_ISDIR(mode):
            if _is_own_folder(folder):
                return
            got = "a folder with files, and without the lock file of a job"
        raise InputError(
            "something else has the name of the folder for unfinished frames",
            where=str(folder),
            got=got,
            hint="rename it, or choose another --output",
        )


def _is_own_folder(folder: Path) -> bool:
    # Names are listed before the lock file is read: a job makes the lock file first, and removes it last.
    names = {*os.listdir(folder)}
    has_others = bool(names - {_LOCK_FILE})
    note = _read_note(folder / _LOCK_FILE)
    if note is None:
        return not has_others or _LOCK_FILE in names
    return _OWNER_PATTERN.fullmatch(note) is not None or not (note or has_others)


def _read_note(file: Path) -> bytes | None:
    """Return the first bytes of a lock file, where a job writes its process and its machine; None if it is missing."""
    with contextlib.suppress(FileNotFoundError):
        _require_regular(file)
        with file.open("rb") as stream:
            return stream.read(_MAX_OWNER_BYTES)
    return None


def _foreign_lock_file(file: Path, got: str) -> InputError:
    what = "something else has the name of the lock file"
    return InputError(what, where=str(file), got=got, hint="rename or remove it")


def _acquire_gate(file: Path, *, owns_folder: bool) -> int:
    """Open or make a lock file, and return its descriptor with the gate locked."""
    folder = file.parent
    while True:
        folder.parent.mkdir(parents=True, exist_ok=True)
        with contextlib.suppress(FileExistsError):
            folder.mkdir()
        if owns_folder:
            require_own_folder(folder)
        elif (note := _read_note(file)) and not _OWNER_PATTERN.fullmatch(note):
            raise _foreign_lock_file(file, "a file of another program")
        # A job that leaves may just have removed the file and the folder.
        with contextlib.suppress(FileNotFoundError), contextlib.ExitStack() as stack:
            descriptor = _open(file)
            stack.callback(os.close, descriptor)
            lock_bytes(descriptor, _GATE_BYTE, 1, wait=True)
            if is_path_of(file, descriptor):
                stack.pop_all()
                return descriptor


def _open(file: Path) -> int:
    """Open a lock file, or make it, and return its descriptor.

    Raises FileNotFoundError if the folder is missing, and InputError if the path is something else than a file.
    """
    flags = os.O_RDWR | os.O_CLOEXEC | os.O_NOFOLLOW
    while True:
        with contextlib.suppress(FileNotFoundError):
            _require_regular(file)
            return os.open(file, flags)  # with O_CREAT, files of other users in /tmp could not be opened
        with contextlib.suppress(FileExistsError):
            descriptor = os.open(file, flags | os.O_CREAT | os.O_EXCL, 0o600)
            _copy_folder_permissions(descriptor, file.parent)
            return descriptor


def _require_regular(file: Path) -> None:
    mode = file.lstat().st_mode
    if not stat.S_ISREG(mode):
        kinds = ((stat.S_ISLNK, "a link"), (stat.S_ISDIR, "a folder"))
        raise _foreign_lock_file(file, next((kind for is_of, kind in kinds if is_of(mode)), "a device or a pipe"))


def _copy_folder_permissions(descriptor: int, folder: Path) -> None:
    """Permit all users who may write in the folder to lock the file, as the file stays if its job is killed.

    descriptor: the descriptor of the lock file, which this user has just made.
    """
    with contextlib.suppress(OSError):  # some file systems have no owners
        status = folder.stat()
        for owner in (-1, status.st_uid):  # a superuser also gives the file to the owner of the folder
            with contextlib.suppress(OSError):  # this user may not belong to the folder's group
                os.fchown(descriptor, owner, status.st_gid)
        is_same_group = os.fstat(descriptor).st_gid == status.st_gid
        group = 0o060 if status.st_mode & stat.S_IWGRP and is_same_group else 0
        others = 0o006 if status.st_mode & stat.S_IWOTH else 0
        os.fchmod(descriptor, 0o600 | group | others)


def _acquire_slots(descriptor: int, slots: Sequence[int], output: Path) -> None:
    """Lock slots of an open lock file, and unlock its gate. Raises OutputLockedError if another job holds a slot."""
    for start, stop in consecutive_ranges(slots):
        if lock_bytes(descriptor, _FIRST_SLOT_BYTE + start, stop - start) is False:
            raise OutputLockedError(
                "another job is writing this output",
                where=str(output),
                got=os.pread(descriptor, _MAX_OWNER_BYTES, 0).decode(errors="replace") or None,
                hint="wait until it has finished, or choose another output",
            )
    _write_owner(descriptor)
    unlock_bytes(descriptor, _GATE_BYTE, 1)


def _write_owner(descriptor: int) -> None:
    note, is_new = f"process {os.getpid()} on {os.uname().nodename}".encode(), os.fstat(descriptor).st_size == 0
    os.pwrite(descriptor, note, 0)
    os.ftruncate(descriptor, len(note))  # comes last, so that the file is never empty
    if is_new:  # the file must show after a power failure, too, that hsplat made the folder
        sync_to_disk(descriptor)


def _release_slots(file: Path, descriptor: int, *, owns_folder: bool) -> None:
    """Unlock the slots. The last job removes temporary files, the lock file, and the folder if it is empty."""
    try:
        lock_bytes(descriptor, _GATE_BYTE, 1, wait=True)
        is_last = lock_bytes(descriptor, _GATE_BYTE, 0)
        if is_last is False or (is_last and not is_path_of(file, descriptor)):
            return
        if is_last and owns_folder:  # without locks, `is_last` is None, as there may be other jobs
            remove_temporaries(file.parent)
        if owns_folder and any(entry.name != file.name for entry in os.scandir(file.parent)):
            return
        file.unlink(missing_ok=True)
        if owns_folder:
            file.parent.rmdir()
    except OSError:  # the folder is not empty, or has vanished
        pass
    finally:
        # Closing is not enough: a child that just starts may share the open file.
        unlock_bytes(descriptor, _GATE_BYTE, 0)
        os.close(descriptor)
