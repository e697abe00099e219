"""Decode an MP4 or a GIF, frame by frame, with the ffmpeg that imageio-ffmpeg contains.

The file may come from anywhere: its format and protocol are fixed, and ffmpeg is a process of its own. PyAV and imageio
could not replace the pipe: they offer no exact, processor-independent conversion of colours.
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

from renderer.errors import InputError
from renderer.film.encode import start_ffmpeg
from renderer.film.picture import Pixels
from renderer.film.stream_tail import StreamTail
from renderer.scene import counted, require_file
from renderer.system import join_lines

# ffmpeg's most exact conversion, the same on every processor; its fast one makes all pixels about one step darker. The
# chroma position is H.264's default, left, as in encode.py. A GIF may be transparent.
_RGB_FILTER = "scale=in_h_chr_pos=0:flags=bicubic+accurate_rnd+full_chroma_int+full_chroma_inp+bitexact,format=rgb24"
_RGBA_FILTER = "format=rgba"
_PADDING_PX = 64  # decoders may fill up each side to blocks and vectors


@contextlib.contextmanager
def decode_known_film(path: Path, size: tuple[int, int], num_frames: int) -> Iterator[Iterator[Pixels]]:
    """Decode a film of a known size (width, height) and number of frames, in order: uint8 [h, w, 3].

    Read it to the end, which says whether frames are missing. Raises InputError as `decode_film`, and for another size
    or number of frames.
    """
    width, height = size
    with decode_film(path, (width + _PADDING_PX) * (height + _PADDING_PX)) as frames:
        yield _known_frames(frames, (height, width), num_frames, path)


def _known_frames(frames: Iterator[Pixels], shape: tuple[int, int], num_frames: int, path: Path) -> Iterator[Pixels]:
    number, expected = 0, counted(num_frames, "frame")
    for number, frame in enumerate(frames, 1):
        if frame.shape[:2] != shape:
            got, right = ("{1} x {0} pixels".format(*lengths) for lengths in (frame.shape, shape))
            raise InputError("a film of another size", where=str(path), got=got, expected=right)
        if number > num_frames:
            raise InputError("a film with more frames", where=str(path), expected=expected)
        yield frame[..., :3]
    if number < num_frames:
        raise InputError("a film with fewer frames", where=str(path), got=counted(number, "frame"), expected=expected)


def count_film_frames(path: Path, max_pixels: int) -> int:
    """Decode a film and return its number of frames. Raises InputError as `decode_film`."""
    with decode_film(path, max_pixels) as frames:
        return sum(1 for _ in frames)


@contextlib.contextmanager
def decode_film(path: Path, max_pixels: int) -> Iterator[Iterator[Pixels]]:
    """Decode the frames of a film in order: uint8 [h, w, 3], of a GIF [h, w, 4]. ffmpeg ends with the block.

    Raises InputError if the file is no MP4 or GIF, is cut off, cannot be decoded to its end, or has larger frames than
    `max_pixels`, which ffmpeg refuses before it allocates them; RenderError without ffmpeg. A file that ends between
    two frames is a shorter film, and H.264 has no checksum: some damage shows in the pictures alone.
    """
    _require_film(path)
    process = start_ffmpeg(_arguments(path, max_pixels), path, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE)
    assert process.stdout is not None and process.stderr is not None
    with process.stdout as pictures:
        try:
            yield _frames(process, pictures, StreamTail(process.stderr), path)
        finally:
            process.kill()
            process.wait()


def _arguments(path: Path, max_pixels: int) -> list[str]:
    is_gif = path.suffix.lower() == ".gif"
    # The format is fixed, because other formats may refer to further files. PAM has the size of each picture.
    source = ["-protocol_whitelist", "file", "-f", "gif" if is_gif else "mov", "-max_pixels", str(max_pixels)]
    colors = _RGBA_FILTER if is_gif else _RGB_FILTER
    sink = ["-map", "0:v:0", "-vf", colors, "-fps_mode", "passthrough", "-f", "image2pipe", "-c:v", "pam", "pipe:1"]
    general = ["-hide_banner", "-nostdin", "-loglevel", "error", "-xerror", "-err_detect", "explode"]
    return [*general, *source, "-i", f"file:{path}", *sink]


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
