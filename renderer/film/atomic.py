"""Files appear under their final name when they are complete, or not at all."""

from __future__ import annotations

import contextlib
import errno
import os
from collections.abc import Callable, Iterator
from pathlib import Path

from renderer.errors import HsplatError, InputError, RenderError


@contextlib.contextmanager
def staged_file(path: Path, within: Path | None = None) -> Iterator[Path]:
    """A temporary file beside `path`, or in the folder `within` on the same disk, renamed to `path` after the block.

    Missing folders are made, but for `within`, and the temporary file is created at once: what cannot be written is
    told before the work, not after it. When the block raises, KeyboardInterrupt included, the temporary file is removed
    and `path` is left as it was. What the operating system refuses becomes InputError (the name cannot be a file) or
    RenderError (no space, no permission, no folder any more); an OSError raised by the block itself passes unchanged,
    see `explained`.
    """
    temporary = _temporary_path(path, within)
    try:  # before the file is there: an interrupt may come at any time
        _create(temporary, path, within)
        yield temporary
        with translate_os_errors(path):
            os.replace(temporary, path)
    finally:
        # After the rename there is nothing left to remove; a failure to remove must not hide the error that led here.
        with contextlib.suppress(OSError):
            temporary.unlink()


def write_staged(path: Path, content: bytes, within: Path | None = None) -> None:
    """Write a whole file so that it is there complete or not at all; as `staged`."""
    with staged_file(path, within) as temporary, translate_os_errors(path):
        temporary.write_bytes(content)


@contextlib.contextmanager
def staged_files(within: Path | None = None) -> Iterator[Callable[[Path, bytes], None]]:
    """A function that writes whole files, which have their final names at the end of the block, one after the other.

    When the block raises, none has; as `staged`.
    """
    written: list[tuple[Path, Path]] = []

    def write(path: Path, content: bytes) -> None:
        temporary = _temporary_path(path, within)
        written.append((temporary, path))
        _create(temporary, path, within)
        with translate_os_errors(path):
            temporary.write_bytes(content)

    try:
        yield write
        for temporary, path in written:
            with translate_os_errors(path):
                os.replace(temporary, path)
    finally:
        for temporary, _ in written:
            with contextlib.suppress(OSError):
                temporary.unlink()


def require_writable(path: Path, within: Path | None = None) -> None:
    """Make the folder of `path` and try to write there, or `within`, leaving no file; errors as in `staged`."""
    temporary = _temporary_path(path, within)
    try:
        _create(temporary, path, within)
        with translate_os_errors(path):
            if not os.access(path.parent, os.W_OK | os.X_OK):
                raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink()


def require_writable_dry_run(path: Path) -> None:
    """Raise what `require_writable` would, as far as it shows without making a folder or a file."""
    with translate_os_errors(path):
        with contextlib.suppress(FileNotFoundError, NotADirectoryError):
            path.lstat()  # fails for a name that is too long
        if path.is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
        folder = _nearest_existing_parent(path)
        if not folder.is_dir():  # a link that leads nowhere, too
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
    """Turn an OSError met while writing `path` into InputError or RenderError."""
    try:
        yield
    except OSError as error:
        raise output_error(error, path) from error


def output_error(error: OSError, path: Path) -> HsplatError:
    """What to tell about `error`, met while writing `path`."""
    where = str(path)
    if isinstance(error, IsADirectoryError):
        return InputError("the output is a folder", where=where, expected="the name of a file")
    if isinstance(error, (NotADirectoryError, FileExistsError)) or error.errno == errno.ELOOP:
        broken = next((parent for parent in path.parents if parent.is_symlink() and not parent.exists()), None)
        if broken is not None:
            return InputError("the folder of the output is a link that leads nowhere", where=where, got=str(broken))
        if error.errno != errno.ELOOP:  # which a link under another name may cause, too
            file = next((parent for parent in path.parents if parent.is_file()), path.parent)
            return InputError("the folder of the output is a file", where=where, got=str(file))
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        return RenderError("the disk is full", where=where, hint="free some space, or write to another disk")
    if _is_kernel_filesystem(path):
        return RenderError("no files can be made here", where=where, hint=_ANOTHER_FOLDER)
    if isinstance(error, FileNotFoundError):
        return RenderError("the folder of the output is gone", where=where, hint="it was there when the work began")
    if error.errno in (errno.EACCES, errno.EPERM, errno.EROFS):
        return RenderError("no permission to write here", where=where, hint=_ANOTHER_FOLDER)
    return RenderError("the output cannot be written", where=where, got=error.strerror or str(error))


def remove_temporaries(folder: Path) -> None:
    """Remove what programs that were killed left in a folder `within`. Raises OSError."""
    for path in folder.glob(f".*{_MARK}*"):
        path.unlink(missing_ok=True)


_MARK = ".partial-"
_ANOTHER_FOLDER = "choose another folder for the output"
# Not even the superuser makes a file or folder here, whom `os.access` tells otherwise.
_KERNEL_MOUNTS = (Path("/proc"), Path("/sys"))


def _nearest_existing_parent(path: Path) -> Path:
    """The folder that `path` is below, as far as there is one; a link that leads nowhere, or a file, too."""
    return next(parent for parent in path.absolute().parents if os.path.lexists(parent))


def _is_kernel_filesystem(path: Path) -> bool:
    with contextlib.suppress(OSError):  # the current folder is gone
        device = _nearest_existing_parent(path).stat().st_dev
        return any(place.is_mount() and place.stat().st_dev == device for place in _KERNEL_MOUNTS)
    return False


def _temporary_path(path: Path, within: Path | None = None) -> Path:
    # Two programs, on two machines, do not share a temporary file; nor do two frames that differ by their folders.
    return (within or path.parent) / f".{path.name}{_MARK}{os.urandom(4).hex()}"


def _create(temporary: Path, path: Path, within: Path | None) -> None:
    with translate_os_errors(path):
        if within is not None:
            temporary.touch(exist_ok=False)  # first: a folder that has vanished meanwhile is not made again
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
        temporary.touch()
