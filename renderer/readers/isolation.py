"""Run a reader in a child process with limits on memory and time, for formats that large libraries parse.

A file that makes such a library crash, loop or fill the memory ends the child, and raises InputError here. Voxels come
back in a shared file, and everything else as JSON, which is checked like a file: an answer can only be data, not code.
The shared file has the format of NumPy (.npy). It is in memory, on disk without a name, or a file of the cache folder.

This file is also the program of the child: `python -m renderer.readers.isolation` with the request as JSON.
"""

from __future__ import annotations

import importlib
import io
import json
import math
import mmap
import os
import resource
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from contextlib import ExitStack, suppress
from dataclasses import astuple, replace
from pathlib import Path
from typing import IO, Any

import numpy as np
import numpy.typing as npt

from renderer.errors import InputError, RenderError
from renderer.readers.file_errors import errors_about
from renderer.readers.image import Image
from renderer.readers.piece_journal import PieceJournal
from renderer.readers.steps_in_time import TimeSteps
from renderer.readers.units import units_of
from renderer.readers.voxel_limits import check_dtype, check_memory, check_size
from renderer.scene import is_url, short_text
from renderer.system import ChildProcesses, describe_exit, open_anonymous_file
from renderer.volume import Array, Channel, Label, VolumeLevel, tell_pass

# The memory that a child may use beside voxels and files, in bytes.
_MEMORY_BYTES = 1 << 30
# The number of copies of the voxels, and of the largest file, for which a child gets memory: libraries hold the bytes
# that they have read, the voxels that they have decoded, and copies of both.
_NUM_COPIES = 4

# The seconds of processor time that every child gets, whatever it reads.
_SECONDS = 10
# The bytes of voxels for which a child gets another second of processor time.
_BYTES_PER_SECOND = 1 << 20
# The bytes of files for which a child gets another second of processor time. The slowest parser, of text in VTK, reads
# 32 MiB in a second.
_PARSED_BYTES_PER_SECOND = 8 << 20
# The number of files for which a child gets another second of processor time.
_FILES_PER_SECOND = 10

# The largest number of bytes that a child sends to its parent, without the voxels.
_MAX_ANSWER_BYTES = 1 << 24
# The fields of an InputError that a child sends in place of an image.
_ERROR_FIELDS = ("what", "where", "got", "expected", "hint")
# The fields of an Image that a child sends as they are.
_PLAIN_FIELDS = ("notes", "nodata", "steps", "units", "levels", "box", "marks")

# The name of the voxels of an image in an entry of the cache folder.
_VOXELS = "voxels"
# The name of the answer of the child, as bytes of JSON, in an entry of the cache folder.
_ANSWER = "answer"
# The name of the journal of the pieces that were read into an entry of the cache folder that is not whole yet.
_JOURNAL = "pieces.txt"


def allocate_voxels(host: Host, shape: tuple[int, ...], dtype: npt.DTypeLike) -> Array:
    """Return an array of zeros for voxels [z, y, x]; raises InputError for a size of 0, and for too little room."""
    host.require_room(check_size(shape[::-1], dtype))
    return host.allocate(shape, dtype)


def read_isolated(
    reader: str, path: Path | str, *, on_disk: bool = False, entry: Path | None = None, **arguments: Any
) -> Image:
    """Call a reader in a child process, and return its image.

    reader: the function, as `module:function`; its arguments are the path, `arguments`, and a `host`. path: a path, or
        a text that is the URL of a store. on_disk: whether voxels are shared in a temporary file. entry: the folder of
        an entry of the cache folder, in which voxels are shared and from which `kept_image` makes the same image. It
        may have pieces that a process read which was ended: they are not read again.
        arguments: values that JSON can express. Raises InputError if the reader raises one or fails in any other way,
        and RenderError if the child cannot run.
    """
    request = {"reader": reader, "path": str(path), "arguments": arguments, "limits": _limits(path)}
    with ChildProcesses() as children, ExitStack() as files:
        if entry is None:
            voxels = files.enter_context(open_anonymous_file(on_disk=on_disk))
            text = _ask(children, {**request, "folder": tempfile.gettempdir()}, voxels)
        else:
            is_shared = _file_in(entry, _VOXELS).exists()
            voxels = files.enter_context(_file_in(entry, _VOXELS).open("r+b" if is_shared else "w+b"))
            answer = files.enter_context(_file_in(entry, _ANSWER).open("w+b"))
            text = _ask(children, {**request, "folder": str(entry.parent), "journal": str(entry / _JOURNAL)}, voxels)
            np.save(answer, np.frombuffer(text, np.uint8), allow_pickle=False)
        told = json.loads(text)
        shape, dtype, num_bytes = _layout(told)
        first = len(_header(shape, dtype))
        mapped = mmap.mmap(voxels.fileno(), first + num_bytes)
        values = np.frombuffer(mapped, dtype, offset=first).reshape(shape)
        return _image(told, values, is_on_disk=on_disk or entry is not None)


def kept_image(arrays: Mapping[str, Array]) -> Image | None:
    """Return the image in an entry of the cache folder; None if the entry is damaged.

    arrays: the arrays of the entry, by their names.
    """
    try:
        told = json.loads(arrays[_ANSWER].tobytes())
        shape, dtype, _ = _layout(told)
        values = arrays[_VOXELS]
        return _image(told, values, is_on_disk=True) if (values.shape, values.dtype) == (shape, dtype) else None
    except (KeyError, TypeError, ValueError, InputError):
        return None


def share_voxels(image: Image, entry: Path) -> bool:
    """Let a new entry have the file of the voxels of an image that `kept_image` made. Return whether it has.

    Voxels that are read into the new entry are then added to the file.
    """
    if not isinstance(image.values, np.memmap) or image.values.filename is None:
        return False
    with suppress(OSError):  # the entry is removed, or the file system has no links
        _file_in(entry, _VOXELS).hardlink_to(image.values.filename)
        return True
    return False


def _file_in(entry: Path, name: str) -> Path:
    return entry / f"{name}.npy"


def _limits(path: Path | str) -> dict[str, int]:
    """Return the limits of a child that reads a file: bytes of memory, and seconds of processor time."""
    stats = [] if isinstance(path, str) else _stats(path)
    # A sparse file may store fewer bytes than its size: st_blocks counts stored blocks, always in units of 512 bytes.
    num_bytes = sum(min(stat.st_size, 512 * stat.st_blocks) for stat in stats)
    seconds = _SECONDS + len(stats) // _FILES_PER_SECOND + num_bytes // _PARSED_BYTES_PER_SECOND
    memory = _MEMORY_BYTES + _NUM_COPIES * max((stat.st_size for stat in stats), default=0)
    return {"memory": memory, "seconds": seconds}


def _ask(children: ChildProcesses, request: dict[str, Any], voxels: IO[bytes]) -> bytes:
    """Let a child call a reader, and return the image that it answers with, as JSON.

    request: the reader, its path and its arguments, the limits of the child, the folder of the shared file for
    messages, and the path of a journal, if pieces are remembered. voxels: the shared file. Raises InputError if the
    answer is an error, or if there is none.
    """
    receiver, sender = os.pipe()
    with open(receiver, "rb") as answers:
        try:
            child = children.start(
                __name__,
                [str(sender), str(voxels.fileno()), json.dumps(request)],
                pass_fds=(sender, voxels.fileno()),
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )
        except OSError as error:
            raise _no_process_error(request["path"], str(error)) from error
        finally:
            os.close(sender)
        text = _last_line(answers)
    status = child.wait()
    if not text:
        raise _no_process_error(request["path"], describe_exit(status))
    answer = json.loads(text)
    if isinstance(answer, str):
        seconds = request["limits"]["seconds"]
        raise InputError(
            "reading this file ended the process that decodes it",
            where=answer,
            got=describe_exit(status),
            expected=f"at most {_MEMORY_BYTES >> 20} MiB beside the voxels and {seconds} s without them",
            hint="the file is damaged, or made to do harm",
        )
    if "what" in answer:
        what, *others = (answer[name] for name in _ERROR_FIELDS)
        raise InputError(what, **dict(zip(_ERROR_FIELDS[1:], others, strict=True)))
    return text


def _last_line(answers: IO[bytes]) -> bytes:
    """Return the last line that a child has sent. Lines on progress are told to the watcher of passes, and left out."""
    last = b""
    while (line := answers.readline(_MAX_ANSWER_BYTES)).endswith(b"\n"):  # the child may end within a line
        if not line.startswith(b"["):
            last = line
            continue
        num_read, num_bytes, what = json.loads(line)
        tell_pass(int(num_read), int(num_bytes), str(what))
    return last


def _stats(path: Path) -> list[os.stat_result]:
    """Return the states of a file, or of the files directly in a folder."""
    files = [entry for entry in os.scandir(path) if entry.is_file()] if path.is_dir() else [path]
    return [file.stat() for file in files]


def _no_process_error(path: str, got: str) -> RenderError:
    return RenderError(
        "the process that decodes this file cannot be started",
        where=path,
        got=got,
        hint="check that `sys.executable` is a Python that runs, and that the system allows another process",
    )


def _layout(answer: dict[str, Any]) -> tuple[tuple[int, ...], np.dtype[Any], int]:
    """Return the shape, the type and the number of bytes of the voxels that the answer of a child describes."""
    shape, dtype = tuple(int(n) for n in answer["shape"]), np.dtype(str(answer["dtype"]))
    check_dtype(dtype)
    return shape, dtype, check_size(shape, dtype)


def _header(shape: tuple[int, ...], dtype: np.dtype[Any]) -> bytes:
    """Return the beginning of a file of NumPy with an array of this shape and type."""
    header = io.BytesIO()
    fields = {"descr": dtype.str, "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(header, fields)
    return header.getvalue()


def _image(answer: dict[str, Any], values: Array, *, is_on_disk: bool) -> Image:
    """Return the image that the answer of a child describes. values: its voxels. is_on_disk: as in Image."""
    world_from_index = np.array(answer["world_from_index"], np.float64).reshape(4, 4)
    nodata = tuple((float(low), float(high)) for low, high in answer["nodata"])
    channels = tuple(_channel(*each) for each in answer["channels"])
    count, times, unit = answer["steps"]
    steps = TimeSteps(int(count), tuple(float(time) for time in times), "s" if unit == "s" else "")
    units = units_of(*map(str, answer["units"]))
    labels = tuple(_label(*each) for each in answer["labels"])
    notes = tuple(answer["notes"])
    image = Image(values, world_from_index, notes, nodata, channels, labels=labels, steps=steps, units=units)
    image = replace(image, marks=str(answer["marks"]), is_on_disk=is_on_disk)
    if answer["box"] is not None:
        image = replace(image, box=tuple((int(begin), int(end)) for begin, end in answer["box"]))
    if "finest_from_index" not in answer:
        return image
    return replace(
        image,
        levels=tuple(_level(*each) for each in answer["levels"]),
        finest_from_index=np.array(answer["finest_from_index"], np.float64).reshape(4, 4),
    )


def _level(shape: Any, chunks: Any, num_bytes: Any, is_read: Any) -> VolumeLevel:
    """Return the facts about a level that the answer of a child describes."""
    (x, y, z), (i, j, k) = map(int, shape), map(int, chunks)
    return VolumeLevel((x, y, z), (i, j, k), int(num_bytes), bool(is_read))


def _channel(name: Any, color: Any, window: Any, is_light: Any, is_hidden: Any) -> Channel:
    """Return a channel that the answer of a child describes; an invalid colour or window is left out."""
    shade, ends = (tuple(float(each) for each in numbers or ()) for numbers in (color, window))
    is_color = len(shade) == 3 and all(0 <= part <= 1 for part in shade)
    is_window = len(ends) == 2 and -math.inf < ends[0] < ends[1] < math.inf
    return Channel(
        short_text(str(name)),
        (shade[0], shade[1], shade[2]) if is_color else None,
        (ends[0], ends[1]) if is_window else None,
        None if is_light is None else bool(is_light),
        bool(is_hidden),
    )


def _label(value: Any, name: Any, color: Any, opacity: Any) -> Label:
    """Return a label that the answer of a child describes; an invalid colour or opacity is left out."""
    shade = tuple(float(part) for part in color or ())
    is_color = len(shade) == 3 and all(0 <= part <= 1 for part in shade)
    is_opacity = opacity is not None and 0 <= float(opacity) <= 1
    return Label(
        int(value),
        str(name),
        (shade[0], shade[1], shade[2]) if is_color else None,
        float(opacity) if is_opacity else None,
    )


class Host:
    """The child process as its reader sees it: a shared file for voxels, and lines of JSON to the parent."""

    def __init__(self, sender: IO[bytes], descriptor: int, folder: str, journal: str | None) -> None:
        self._sender, self._descriptor, self._folder = sender, descriptor, folder
        self._journal = None if journal is None else PieceJournal(Path(journal))
        self.values: Array | None = None

    def expect_bytes(self, num_bytes: int) -> None:
        """Extend the limit of memory by `num_bytes`, for a library that needs them before `allocate` is called."""
        _extend_limit(resource.RLIMIT_AS, num_bytes)

    def begin_file(self, path: Path | str) -> None:
        """Tell the parent the name of the next file, for the message if reading it ends the process."""
        self.send(str(path))

    def tell_progress(self, num_read: int, num_bytes: int, what: str) -> None:
        """Tell the parent how many bytes of voxels were read, beginning with 0. what: a name for them in messages."""
        self.send([num_read, num_bytes, what])

    def send(self, answer: str | list[Any] | dict[str, Any]) -> None:
        """Send a line to the parent: the name of the next file, the progress, or last the answer."""
        self._sender.write(json.dumps(answer).encode("ascii") + b"\n")
        self._sender.flush()

    def allocate(self, shape: tuple[int, ...], dtype: npt.DTypeLike) -> Array:
        """Return an array of zeros in the shared file, which the reader fills with voxels and returns.

        The array replaces an earlier one, and has native byte order. The limits of the process grow by its size.
        """
        header = _header(tuple(map(int, shape)), np.dtype(dtype))
        num_bytes = math.prod(shape) * np.dtype(dtype).itemsize
        self.expect_bytes((1 + _NUM_COPIES) * num_bytes)
        _extend_limit(resource.RLIMIT_CPU, num_bytes // _BYTES_PER_SECOND)
        os.ftruncate(self._descriptor, len(header) + num_bytes)
        mapped = mmap.mmap(self._descriptor, len(header) + num_bytes)
        mapped[: len(header)] = header
        self.values = np.frombuffer(mapped, dtype, offset=len(header)).reshape(shape)
        return self.values

    def fill(self, part: Array, voxels: Array) -> None:
        """Write voxels to a part of the array that `allocate` returned.

        A contiguous part is written to the file: the system takes a third of the time that the pages of a map take.
        """
        if self.values is None or not part.flags.c_contiguous:
            part[...] = voxels
            return
        first = len(_header(self.values.shape, self.values.dtype)) + part.ctypes.data - self.values.ctypes.data
        left = np.ascontiguousarray(voxels, part.dtype).reshape(-1).view(np.uint8).data
        while left:
            num_written = os.pwrite(self._descriptor, left, first)
            left, first = left[num_written:], first + num_written

    def has_piece(self, name: str, voxels: Array) -> bool:
        """Return whether an earlier process has read a piece of the array that `allocate` returned."""
        return self._journal is not None and self._journal.has(name, voxels)

    def add_piece(self, name: str, voxels: Array) -> None:
        """Remember that a piece was read, for a later process, if this one is ended. name: as in `has_piece`."""
        if self._journal is not None:
            self._journal.add(name, voxels)

    def require_room(self, num_bytes: int) -> None:
        """Raise InputError if there is no room for this many bytes in memory, or on the disk of the shared file.

        The bytes that the file has on the disk have room.
        """
        disk = os.fstatvfs(self._descriptor)
        free = disk.f_bavail * disk.f_frsize + 512 * os.fstat(self._descriptor).st_blocks
        if disk.f_blocks == 0:  # a file in memory
            check_memory(num_bytes)
        elif num_bytes > free:
            raise InputError(
                "there is no room on the disk for these voxels",
                where=self._folder,
                got=f"{num_bytes / 2**30:.1f} GiB",
                expected=f"at most the {free / 2**30:.1f} GiB that are free",
                hint="name another folder, by `TMPDIR` or `--cache`; or take a coarser `level`, or `crop`",
            )


def _extend_limit(kind: int, more: int) -> None:
    limit = resource.getrlimit(kind)[0]
    if limit != resource.RLIM_INFINITY:
        _set_limit(kind, limit + more)


def _set_limit(kind: int, limit: int) -> None:
    """Set a limit of this process, at most to its hard limit."""
    most = resource.getrlimit(kind)[1]
    resource.setrlimit(kind, (limit if most == resource.RLIM_INFINITY else min(limit, most), most))


def _limit_child(memory: int, seconds: int) -> None:
    """Set the limits of this process: further memory in bytes, processor time in seconds, and no core dumps."""
    status = Path("/proc/self/statm")
    if status.exists():
        _set_limit(resource.RLIMIT_AS, int(status.read_text("ascii").split()[0]) * resource.getpagesize() + memory)
    _set_limit(resource.RLIMIT_CPU, seconds)
    _set_limit(resource.RLIMIT_CORE, 0)


def import_reader(reader: str) -> Callable[..., Image]:
    """Return the function that a text names as `module:function`."""
    module, _, name = reader.partition(":")
    function: Callable[..., Image] = getattr(importlib.import_module(module), name)
    return function


def call_reader(reader: str, path: Path | str, arguments: dict[str, Any], host: Host) -> Image:
    """Call a reader and return its image; raises InputError for any exception of its library."""
    function = import_reader(reader)
    with errors_about(path):
        try:
            return function(path, **arguments, host=host)
        except InputError:
            raise
        except Exception as error:
            raise InputError(
                "this file cannot be decoded",
                got="more memory than is allowed" if isinstance(error, MemoryError) else None,
                hint="it is truncated or damaged, or of a kind that cannot be read",
            ) from error


def _main() -> None:
    """Read one file, as the child process. Arguments: the descriptors of the answer and the voxels, and the request."""
    sender, descriptor, request = int(sys.argv[1]), int(sys.argv[2]), json.loads(sys.argv[3])
    _limit_child(**request["limits"])
    with open(sender, "wb") as file:
        child, path = Host(file, descriptor, request["folder"], request.get("journal")), request["path"]
        path = path if is_url(path) else Path(path)
        child.begin_file(path)
        try:
            image = call_reader(request["reader"], path, request["arguments"], child)
        except InputError as error:
            child.send({name: getattr(error, name) for name in _ERROR_FIELDS})
            return
        assert image.values is child.values, "readers return what they have allocated"
        answer = {name: getattr(image, name) for name in _PLAIN_FIELDS}
        answer |= {"shape": image.values.shape, "dtype": image.values.dtype.str}
        answer |= {"world_from_index": image.world_from_index.tolist(), "channels": [*map(astuple, image.channels)]}
        answer |= {"labels": [*map(astuple, image.labels)]}
        if image.finest_from_index is not None:
            answer["finest_from_index"] = image.finest_from_index.tolist()
        child.send(answer)


if __name__ == "__main__":
    _main()
