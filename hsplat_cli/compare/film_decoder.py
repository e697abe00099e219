"""Films to pictures: every frame of an MP4 or a GIF, through the ffmpeg that imageio-ffmpeg brings along.

ffmpeg takes a file that ends between two frames for a shorter film: whether it is whole is looked at before.
"""

from __future__ import annotations

import contextlib
import math
import mmap
import re
import struct
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import IO

import imageio_ffmpeg
import numpy as np

from hsplat_cli.compare.pair import Pixels
from hsplat_cli.compare.picture_file import MAX_PIXELS, require_file
from renderer.errors import InputError
from renderer.film import find_ffmpeg

# As exact as ffmpeg converts, and the same on every processor. A GIF may be transparent.
_RGB_FILTER = "scale=flags=bicubic+accurate_rnd+full_chroma_int+full_chroma_inp+bitexact,format=rgb24"
_RGBA_FILTER = "format=rgba"

_MAX_STDERR_BYTES = 2000

_Bytes = mmap.mmap


def count_film_frames(path: Path) -> int:
    """How many frames a film has; all of them are decoded. Raises InputError as `decode_film`."""
    with decode_film(path) as frames:
        return sum(1 for _ in frames)


@contextlib.contextmanager
def decode_film(path: Path) -> Iterator[Iterator[Pixels]]:
    """The frames of a film, one after the other: uint8 [h, w, 3], of a GIF [h, w, 4].

    However the block ends, ffmpeg has ended too. Raises InputError where the file is no MP4 or GIF, is cut off or
    cannot be decoded to its end, or has frames of more than MAX_PIXELS; RenderError where ffmpeg is missing.
    """
    _require_complete(path)
    with contextlib.ExitStack() as stack:
        try:
            stderr_file = stack.enter_context(tempfile.TemporaryFile())
            # Out of reach of the terminal: Ctrl-C there is for us, and we end ffmpeg when we are done with it.
            process = subprocess.Popen(
                _command(path),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=stderr_file,
                start_new_session=True,
            )
        except (OSError, subprocess.SubprocessError) as error:
            raise InputError("ffmpeg cannot be started", where=str(path), got=str(error)) from error
        assert process.stdout is not None
        try:
            yield _frames(process, process.stdout, stderr_file, path)
        finally:
            process.kill()
            process.wait()
            process.stdout.close()


def _command(path: Path) -> list[str]:
    is_gif = path.suffix.lower() == ".gif"
    # What the name says is what it is read as: other formats may name files to be read in their place.
    source = ["-f", "gif" if is_gif else "mov", "-max_pixels", str(MAX_PIXELS), "-i", f"file:{path}"]
    # PAM says how large each picture is.
    sink = [
        "-map",
        "0:v:0",
        "-vf",
        _RGBA_FILTER if is_gif else _RGB_FILTER,
        "-f",
        "image2pipe",
        "-c:v",
        "pam",
        "pipe:1",
    ]
    general = ["-hide_banner", "-nostdin", "-loglevel", "error", "-xerror", "-err_detect", "explode"]
    return [find_ffmpeg(path), *general, *source, *passthrough_option(_version()), *sink]


_version = cache(imageio_ffmpeg.get_ffmpeg_version)  # asks the program, which takes as long as a short film


def passthrough_option(version: str) -> list[str]:
    """The option that keeps ffmpeg from leaving out or repeating frames; its name changed with version 5.1."""
    number = re.match(r"n?(\d+)\.(\d+)", version)
    is_old = number is not None and (int(number[1]), int(number[2])) < (5, 1)
    return ["-vsync", "0"] if is_old else ["-fps_mode", "passthrough"]


def _frames(
    process: subprocess.Popen[bytes], stream: IO[bytes], stderr_file: IO[bytes], path: Path
) -> Iterator[Pixels]:
    is_whole = True
    while is_whole and (shape := _read_pam_header(stream)) is not None:
        content = stream.read(math.prod(shape))
        is_whole = len(content) == math.prod(shape)
        if is_whole:
            yield np.frombuffer(content, np.uint8).reshape(shape)
    status = process.wait()
    stderr_file.seek(0)
    messages = stderr_file.read(_MAX_STDERR_BYTES).decode("utf-8", "replace").strip()
    if status != 0 or messages or not is_whole:  # not every error lets ffmpeg fail
        got = "\n    ".join(messages.splitlines()) or f"exit status {status} of ffmpeg and no message"
        raise InputError("the film cannot be decoded", where=str(path), got=got)


def _read_pam_header(stream: IO[bytes]) -> tuple[int, int, int] | None:
    """(height, width, channels) from the header of the next picture; None where there is none."""
    fields: dict[bytes, bytes] = {}
    while (line := stream.readline()).strip() != b"ENDHDR":
        if not line:
            return None
        name, _, value = line.strip().partition(b" ")
        fields[name] = value
    return int(fields[b"HEIGHT"]), int(fields[b"WIDTH"]), int(fields[b"DEPTH"])


# Whether a file is whole


def _require_complete(path: Path) -> None:
    is_gif = path.suffix.lower() == ".gif"
    kind = "a GIF" if is_gif else "an MP4"
    require_file(path, f"{kind} file")
    try:
        with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
            begins = content[:6] in (b"GIF87a", b"GIF89a") if is_gif else content[4:8] == b"ftyp"
            whole: Callable[[_Bytes], bool] = _is_complete_gif if is_gif else _is_complete_mp4
            is_whole = begins and whole(content)
            num_bytes = len(content)
    except ValueError as error:  # nothing to be mapped
        raise InputError("an empty file", where=str(path), expected=f"{kind} file") from error
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", where=str(path)) from error
    if not begins:
        raise InputError(f"not {kind} file", where=str(path))
    if not is_whole:
        ends = "cut off" if is_gif else "cut off, or followed by something else"
        raise InputError(f"{kind} file that is {ends}", where=str(path), got=f"{num_bytes} bytes")


def _is_complete_mp4(content: _Bytes) -> bool:
    """Whether the last of its boxes ends where the file does (ISO/IEC 14496-12, 4.2)."""
    position = 0
    while position + 8 <= len(content):
        (size,) = struct.unpack_from(">I", content, position)
        if size == 0:  # up to the end, wherever that is
            return True
        if size == 1 and position + 16 <= len(content):
            (size,) = struct.unpack_from(">Q", content, position + 8)
        if size < 8:
            return False
        position += size
    return position == len(content)


def _is_complete_gif(content: _Bytes) -> bool:
    """Whether its blocks lead to the trailer (GIF89a specification, 1990)."""
    try:
        position = 13 + _color_table_bytes(content[10])
        while (introducer := content[position]) != 0x3B:
            if introducer == 0x21:  # an extension and its label
                position += 2
            elif introducer == 0x2C:  # an image, its colours, and the code size
                position += 11 + _color_table_bytes(content[position + 9])
            else:
                return False
            while content[position]:  # sub-blocks, the last of which is empty
                position += 1 + content[position]
            position += 1
    except IndexError:
        return False
    return True


def _color_table_bytes(flags: int) -> int:
    return 3 * 2 ** (1 + (flags & 7)) if flags & 0x80 else 0
