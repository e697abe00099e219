"""Write files whole or not at all: under a temporary name, renamed at the end."""

from __future__ import annotations

import contextlib
import errno
import os
import re
import stat
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Protocol

from renderer.errors import HsplatError, InputError, RenderError


class StageFile(Protocol):
    """A function that makes a temporary file for a path, and its missing folders.

    folder: an existing folder for the temporary file, on the disk of the path; None for the folder of the path.
    """

    def __call__(self, path: Path, folder: Path | None = None) -> Path: ...


@contextlib.contextmanager
def staging(*, is_durable: bool = True) -> Iterator[StageFile]:
    """Yield a function that makes a temporary file for a path. After the block, all files are renamed, one by one.

    If the block raises, KeyboardInterrupt included, temporary files are removed and nothing else changes. Refusals of
    the operating system become InputError or RenderError, as in `translate_os_errors`; an OSError that the block raises
    passes unchanged.

    is_durable: whether to wait until the files are on the disk before they are renamed. Without it, a power failure may
    leave a file empty under its final name.
    """
    staged: list[tuple[Path, Path]] = []

    def stage(path: Path, folder: Path | None = None) -> Path:
        temporary = _temporary_path(path, folder)
        staged.append((temporary, path))  # before the file is made, as an interrupt may come at any time
        _create(temporary, path, folder)
        return temporary

    try:
        yield stage
        for temporary, path in staged if is_durable else ():
            with translate_os_errors(path), temporary.open("rb") as stream:
                sync_to_disk(stream.fileno())
        for temporary, path in staged:
            with translate_os_errors(path):
                os.replace(temporary, path)
    finally:
        # A failure to remove a file must not hide the error of the block.
        for temporary, _ in staged:
            with contextlib.suppress(OSError):
                temporary.unlink()


@contextlib.contextmanager
def staged_files(folder: Path | None = None, *, is_durable: bool = True) -> Iterator[Callable[[Path, bytes], None]]:
    """Yield a function that writes the content of a file. After the block, all files get their final names.

    folder, is_durable, and what happens when the block raises: as in `staging`.
    """
    with staging(is_durable=is_durable) as stage:

        def write(path: Path, content: bytes) -> None:
            with translate_os_errors(path):
                stage(path, folder).write_bytes(content)

        yield write


def write_staged(path: Path, content: bytes, folder: Path | None = None, *, is_durable: bool = True) -> None:
    """Write one file, whole or not at all.

    folder: an existing folder for the temporary file, on the disk of the path; None for the folder of the path.
    is_durable: whether to wait until the file is on the disk before it gets its final name.
    """
    with staged_files(folder, is_durable=is_durable) as write:
        write(path, content)


def sync_to_disk(descriptor: int) -> None:
    """Wait until all bytes of an open file are on the disk, as far as the file system can. Raises OSError."""
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOSYS, errno.ENOTSUP):
            raise


def require_writable(path: Path, folder: Path | None = None) -> None:
    """Make the folder of `path`, and raise InputError or RenderError unless the file `path` can be written.

    folder: the folder in which the file will be written under a temporary name; None for the folder of the path.
    """
    temporary = _temporary_path(path, folder)
    try:
        _create(temporary, path, folder)
        with translate_os_errors(path):
            if not os.access(path.parent, os.W_OK | os.X_OK):
                raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink()


def require_writable_dry_run(path: Path) -> None:
    """Raise InputError or RenderError if `path` cannot be written. No file or folder is made to find this out."""
    with translate_os_errors(path):
        with contextlib.suppress(FileNotFoundError, NotADirectoryError):
            path.lstat()  # raises an error if the name is too long
        _require_replaceable(path)
        folder = _nearest_existing_parent(path)
        if not folder.is_dir():  # a file or a broken link may have the folder's name
            raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR), str(path))
        if _is_kernel_filesystem(path):
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(path))
        longest = max(
            _temporary_path(path).absolute().relative_to(folder).parts, key=lambda name: len(os.fsencode(name))
        )
        if len(os.fsencode(longest)) > os.pathconf(folder, "PC_NAME_MAX"):
            raise OSError(errno.ENAMETOOLONG, os.strerror(errno.ENAMETOOLONG), str(path))
        if not os.access(folder, os.W_OK | os.X_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))


@contextlib.contextmanager
def translate_os_errors(path: Path) -> Iterator[None]:
    """Raise InputError (the name cannot be a file) or RenderError (no space, no permission) for an OSError."""
    try:
        yield
    except OSError as error:
        raise output_error(error, path) from error


def output_error(error: OSError, path: Path) -> HsplatError:
    """Return the error that tells the user of an OSError while `path` was written."""
    where = str(path)
    if isinstance(error, IsADirectoryError):
        return InputError("the output is a folder", where=where, expected="the name of a file")
    if isinstance(error, (NotADirectoryError, FileExistsError)) or error.errno == errno.ELOOP:
        broken = next((parent for parent in path.parents if parent.is_symlink() and not parent.exists()), None)
        if broken is not None:
            return InputError("the output folder is a broken link", where=where, got=str(broken))
        if error.errno != errno.ELOOP:  # a link elsewhere in the path may cause ELOOP, too
            file = next((parent for parent in path.parents if parent.is_file()), path.parent)
            return InputError("the output folder is a file", where=where, got=str(file))
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        return RenderError("the disk is full", where=where, hint="free some space, or write to another disk")
    if _is_kernel_filesystem(path):
        return RenderError("files cannot be created here", where=where, hint=_ANOTHER_FOLDER)
    if isinstance(error, FileNotFoundError):
        return RenderError("the output folder has vanished", where=where, hint="it existed when the work began")
    if error.errno in (errno.EACCES, errno.EPERM, errno.EROFS):
        return RenderError("no permission to write here", where=where, hint=_ANOTHER_FOLDER)
    return RenderError("the output cannot be written", where=where, got=error.strerror or str(error))


def remove_temporaries(folder: Path) -> None:
    """Remove the temporary files that killed programs left in a folder. Raises OSError."""
    for path in folder.iterdir():
        if _TEMPORARY_PATTERN.fullmatch(path.name):
            path.unlink(missing_ok=True)


# The names of temporary files, as `_temporary_path` makes them.
_TEMPORARY_PATTERN = re.compile(r"\..+\.partial-[0-9a-f]{8}", re.DOTALL)
# The hint of errors about a folder in which no file can be made.
_ANOTHER_FOLDER = "choose another folder for the output"
# The folders of the operating system's kernel. Nobody can make files in them, although `os.access` says that the
# superuser can.
_KERNEL_MOUNTS = (Path("/proc"), Path("/sys"))


def _nearest_existing_parent(path: Path) -> Path:
    """Return the nearest parent of `path` that exists, even if it is a file or a broken link."""
    return next(parent for parent in path.absolute().parents if os.path.lexists(parent))


def _is_kernel_filesystem(path: Path) -> bool:
    with contextlib.suppress(OSError):  # the current folder may be gone
        device = _nearest_existing_parent(path).stat().st_dev
        return any(place.is_mount() and place.stat().st_dev == device for place in _KERNEL_MOUNTS)
    return False


def _temporary_path(path: Path, folder: Path | None = None) -> Path:
    # The name is random, so that frames of different folders, and programs on other machines, never share a
    # temporary file.
    return (folder or path.parent) / f".{path.name}.partial-{os.urandom(4).hex()}"


def _create(temporary: Path, path: Path, folder: Path | None) -> None:
    with translate_os_errors(path):
        if folder is not None:
            temporary.touch(exist_ok=False)  # fails if the folder has vanished
        path.parent.mkdir(parents=True, exist_ok=True)
        _require_replaceable(path)
        temporary.touch()


def _require_replaceable(path: Path) -> None:
    """Raise InputError or OSError if the path is taken by something other than a file, such as a device."""
    try:
        status = path.lstat()
    except (FileNotFoundError, NotADirectoryError):
        return
    if path.is_dir():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    if path.exists() and not path.is_file():
        raise InputError("the output is a device or a pipe", where=str(path), expected="the name of a file")
    folder = path.parent.stat()
    if folder.st_mode & stat.S_ISVTX and os.geteuid() not in (0, status.st_uid, folder.st_uid):
        raise PermissionError(errno.EPERM, os.strerror(errno.EPERM), str(path))
