"""Decode every frame of an MP4 or a GIF with the ffmpeg of imageio-ffmpeg.

ffmpeg takes a file that ends between two frames for a shorter film, which is compared with no longer one. PyAV and
imageio could not replace the pipe: they offer no exact, processor-independent conversion of colours.
"""

from __future__ import annotations

import contextlib
import math
import os
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import IO

import numpy as np

from hsplat_cli.compare.picture_file import MAX_PIXELS, require_file
from renderer.errors import InputError
from renderer.film import Pixels, StreamTail, find_ffmpeg
from renderer.system import join_lines

# ffmpeg's most exact conversion, the same on every processor. A GIF may be transparent.
_RGB_FILTER = "scale=flags=bicubic+accurate_rnd+full_chroma_int+full_chroma_inp+bitexact,format=rgb24"
_RGBA_FILTER = "format=rgba"


def count_film_frames(path: Path) -> int:
    """Decode a film and return its number of frames. Raises InputError as `decode_film`."""
    with decode_film(path) as frames:
        return sum(1 for _ in frames)


@contextlib.contextmanager
def decode_film(path: Path) -> Iterator[Iterator[Pixels]]:
    """Decode the frames of a film in order: uint8 [h, w, 3], of a GIF [h, w, 4]. ffmpeg ends with the block.

    Raises InputError if the file is no MP4 or GIF, is cut off, cannot be decoded to its end, or has frames of more than
    MAX_PIXELS, which ffmpeg refuses before it allocates them; RenderError without ffmpeg.
    """
    _require_film(path)
    try:
        # In its own session, so that Ctrl-C reaches only this process, which ends ffmpeg.
        process = subprocess.Popen(
            _command(path),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            start_new_session=True,
        )
    except (OSError, subprocess.SubprocessError) as error:
        raise InputError("ffmpeg cannot be started", where=str(path), got=str(error)) from error
    assert process.stdout is not None and process.stderr is not None
    with process.stdout as pictures:
        try:
            yield _frames(process, pictures, StreamTail(process.stderr), path)
        finally:
            process.kill()
            process.wait()


def _command(path: Path) -> list[str]:
    is_gif = path.suffix.lower() == ".gif"
    # The format is fixed, because other formats may refer to further files. PAM has the size of each picture.
    source = ["-f", "gif" if is_gif else "mov", "-max_pixels", str(MAX_PIXELS), "-i", f"file:{path}"]
    colors = _RGBA_FILTER if is_gif else _RGB_FILTER
    sink = ["-map", "0:v:0", "-vf", colors, "-f", "image2pipe", "-c:v", "pam", "pipe:1"]
    general = ["-hide_banner", "-nostdin", "-loglevel", "error", "-xerror", "-err_detect", "explode"]
    return [find_ffmpeg(path), *general, *source, "-fps_mode", "passthrough", *sink]


def _frames(
    process: subprocess.Popen[bytes], pictures: IO[bytes], stderr_tail: StreamTail, path: Path
) -> Iterator[Pixels]:
    is_whole = True
    while is_whole and (shape := _read_pam_header(pictures)) is not None:
        content = pictures.read(math.prod(shape))
        is_whole = len(content) == math.prod(shape)
        if is_whole:
            yield np.frombuffer(content, np.uint8).reshape(shape)
    status = process.wait()
    messages = stderr_tail.lines()
    if status != 0 or messages or not is_whole:  # some errors leave the exit status at 0
        got = join_lines(messages) or f"exit status {status} of ffmpeg and no message"
        raise InputError("the film cannot be decoded", where=str(path), got=got)


def _read_pam_header(stream: IO[bytes]) -> tuple[int, int, int] | None:
    """Return (height, width, channels) of the next picture; None at the end."""
    fields: dict[bytes, bytes] = {}
    while (line := stream.readline()).strip() != b"ENDHDR":
        if not line:
            return None
        name, _, value = line.strip().partition(b" ")
        fields[name] = value
    return int(fields[b"HEIGHT"]), int(fields[b"WIDTH"]), int(fields[b"DEPTH"])


def _require_film(path: Path) -> None:
    is_gif = path.suffix.lower() == ".gif"
    kind = "a GIF file" if is_gif else "an MP4 file"
    require_file(path, kind)
    try:
        with path.open("rb") as file:
            begin = file.read(8)
            file.seek(-min(len(begin), 1), os.SEEK_END)
            end = file.read()
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", where=str(path)) from error
    if not (begin.startswith((b"GIF87a", b"GIF89a")) if is_gif else begin.endswith(b"ftyp")):
        raise InputError(f"not {kind}", where=str(path), got=None if begin else "an empty file")
    if is_gif and end != b";":
        raise InputError(f"{kind} that is cut off, or followed by other data", where=str(path))
