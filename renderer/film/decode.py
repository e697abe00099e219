"""Decode a film, frame by frame, with the ffmpeg that imageio-ffmpeg contains.

The file may come from anywhere, so its format and protocol are fixed, and ffmpeg is a process of its own. PyAV and
imageio could not replace the pipe: they offer no exact, processor-independent conversion of colours.
"""

from __future__ import annotations

import contextlib
import math
import os
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

import numpy as np

from renderer.errors import InputError
from renderer.film.encode import frame_rate, start_ffmpeg
from renderer.film.picture import Pixels
from renderer.film.stream_tail import StreamTail
from renderer.scene import OutputFile, counted, format_of, require_file
from renderer.system import join_lines

# The filter of ffmpeg's most exact conversion to RGB, which is the same on every processor. The fast conversion would
# make all pixels about one step of 255 darker. The chroma position is H.264's default, left, as in encode.py.
_TO_RGB = "scale=in_h_chr_pos=0:flags=bicubic+accurate_rnd+full_chroma_int+full_chroma_inp+bitexact,format={0}"
# The number of bytes at the beginning of a film that show its format and its encoder.
_HEADER_BYTES = 2**14
# Decoders may pad each side of a picture by up to this number of pixels, to whole blocks and vectors.
_PADDING_PX = 64


@contextlib.contextmanager
def decode_known_film(output: OutputFile, num_frames: int) -> Iterator[Iterator[Pixels]]:
    """Decode the frames of a film whose size, kind of pictures and number of frames are known, in order.

    Only reading the film to its end shows whether frames are missing. Raises InputError as `decode_film` does, and for
    another size or number of frames.
    """
    width, height = output.size
    max_pixels = (width + _PADDING_PX) * (height + _PADDING_PX)
    with decode_film(output.file, max_pixels, known=(output, num_frames)) as frames:
        yield _known_frames(frames, output, num_frames)


def _known_frames(frames: Iterator[Pixels], output: OutputFile, num_frames: int) -> Iterator[Pixels]:
    number, expected, where = 0, counted(num_frames, "frame"), str(output.file)
    shape = output.kind.shape
    for number, frame in enumerate(frames, 1):
        if frame.shape[:2] != shape[:2]:
            got, right = ("{1} x {0} pixels".format(*lengths) for lengths in (frame.shape, shape))
            raise InputError("a film of another size", where=where, got=got, expected=right)
        if number > num_frames:
            raise InputError("a film with more frames", where=where, expected=expected)
        yield frame[..., : shape[2]]
    if number < num_frames:
        raise InputError("a film with fewer frames", where=where, got=counted(number, "frame"), expected=expected)


def count_film_frames(path: Path, max_pixels: int) -> int:
    """Decode a film and return its number of frames. Raises InputError as `decode_film` does.

    max_pixels: the largest allowed number of pixels in a frame.
    """
    with decode_film(path, max_pixels) as frames:
        return sum(1 for _ in frames)


@contextlib.contextmanager
def decode_film(
    path: Path, max_pixels: int, *, known: tuple[OutputFile, int] | None = None
) -> Iterator[Iterator[Pixels]]:
    """Yield an iterator over the frames of a film in order: [h, w, 4], or [h, w, 3] for codecs without alpha.

    The process of ffmpeg that decodes them ends with the block.
    known: the settings with which the film was encoded, and its number of frames. If they are None, pictures have 8
        bits a channel, and equal consecutive frames of a WebP come once.

    Raises InputError if the file has another format than its suffix, is cut off, cannot be decoded to its end, or has
    frames with more than `max_pixels`, which ffmpeg refuses before it allocates them; RenderError without ffmpeg. Not
    all damage is found: a file that ends between two frames looks like a shorter film, and video has no checksum.
    """
    arguments = _arguments(path, _first_bytes(path), max_pixels, known)
    process = start_ffmpeg(arguments, path, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE)
    assert process.stdout is not None and process.stderr is not None
    with process.stdout as pictures:
        try:
            yield _frames(process, pictures, StreamTail(process.stderr), path)
        finally:
            process.kill()
            process.wait()


def _arguments(path: Path, begin: bytes, max_pixels: int, known: tuple[OutputFile, int] | None) -> list[str]:
    """Return the arguments of ffmpeg. begin: the first bytes of the film."""
    file_format, codecs = format_of(path), tuple(format_of(path).codecs.values())
    # The first bytes may show the encoder. If they do not, the film is taken to be of the format's default encoder.
    codec = next((codec for codec in codecs if any(mark in begin for mark in codec.marks)), codecs[0])
    still = _still_demuxer(begin)
    # ffmpeg is told the format, as films of other formats may refer to further files.
    source = ["-protocol_whitelist", "file", "-f", still or file_format.demuxer, "-max_pixels", str(max_pixels)]
    source += [] if codec.decoder is None else ["-c:v", codec.decoder]
    has_alpha = bool(codec.with_alpha) or file_format.filters == "palette"
    depth = known[0].kind.depth if known else 8
    to_rgb = _TO_RGB.format({8: ("rgb24", "rgba"), 16: ("rgb48be", "rgba64be")}[depth][has_alpha])
    if known and known[1] > 1 and codec.merges_frames:  # the only frame of a film may have no duration
        output, num_frames = known
        to_rgb += f",loop={num_frames - 1}:1" if still else f",fps={frame_rate(output)}"
    picked = ["-map", "0:v:0", "-vf", to_rgb]
    if file_format.has_alpha_plane:
        picked = ["-filter_complex", f"{_avif_streams(begin)}{to_rgb}[pictures]", "-map", "[pictures]"]
    sink = [*picked, "-fps_mode", "passthrough", "-f", "image2pipe", "-c:v", "pam", "pipe:1"]
    general = ["-hide_banner", "-nostdin", "-loglevel", "error", "-xerror", "-err_detect", "explode"]
    return [*general, *source, "-i", f"file:{path}", *sink]


def _still_demuxer(begin: bytes) -> str | None:
    """Return the demuxer of a WebP or APNG without animation, such as a film of one frame; None for other files.

    An animated WebP has an extended header (VP8X) with a bit for it; an animated PNG has a chunk acTL.
    """
    if begin[8:12] == b"WEBP" and (begin[12:16] != b"VP8X" or not int.from_bytes(begin[20:21], "big") & 2):
        return "webp_pipe"
    return "png_pipe" if begin.startswith(b"\x89PNG") and b"acTL" not in begin else None


def _avif_streams(begin: bytes) -> str:
    """Return the filter that selects the streams of an AVIF with the colours of the film, and with its alpha, if any.

    An animated AVIF has its first frame as a still picture before the film: brand `avis` of ISO/IEC 23000-22.
    """
    has_alpha, is_film = b"auxid:1" in begin or b"auxiliary:alpha" in begin, begin[8:12] == b"avis"
    first = (1 + has_alpha) * is_film
    return f"[0:v:{first}][0:v:{first + 1}]alphamerge," if has_alpha else f"[0:v:{first}]"


def _frames(
    process: subprocess.Popen[bytes], pictures: IO[bytes], stderr_tail: StreamTail, path: Path
) -> Iterator[Pixels]:
    is_whole = True
    while is_whole and (found := _read_pam_header(pictures)) is not None:
        shape, dtype = found
        num_bytes = math.prod(shape) * dtype.itemsize
        content = pictures.read(num_bytes)
        is_whole = len(content) == num_bytes
        if is_whole:
            yield np.frombuffer(content, dtype).astype(dtype.newbyteorder("="), copy=False).reshape(shape)
    status = process.wait()
    messages = stderr_tail.lines()
    if status != 0 or messages or not is_whole:  # the exit status of ffmpeg is 0 after some errors
        got = join_lines(messages) or f"exit status {status} of ffmpeg and no message"
        raise InputError("the film cannot be decoded", where=str(path), got=got)


def _read_pam_header(stream: IO[bytes]) -> tuple[tuple[int, int, int], np.dtype[Any]] | None:
    """Return (height, width, channels) and the type of the next picture; None at the end of the film."""
    fields: dict[bytes, bytes] = {}
    while (line := stream.readline()).strip() != b"ENDHDR":
        if not line:
            return None
        name, _, value = line.strip().partition(b" ")
        fields[name] = value
    shape = int(fields[b"HEIGHT"]), int(fields[b"WIDTH"]), int(fields[b"DEPTH"])
    return shape, np.dtype("u1" if int(fields[b"MAXVAL"]) < 256 else ">u2")


def _first_bytes(path: Path) -> bytes:
    """Return the first bytes of a film. Raises InputError if it has another format than its suffix, or is cut off."""
    file_format = format_of(path)
    kind = f"{file_format.name} file"
    require_file(path, kind)
    try:
        with path.open("rb") as file:
            begin = file.read(_HEADER_BYTES)
            file.seek(-min(len(begin), 1), os.SEEK_END)
            end = file.read()
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", where=str(path)) from error
    if not file_format.begins.match(begin):
        raise InputError(f"not {kind}", where=str(path), got=None if begin else "an empty file")
    if file_format.ends and end != file_format.ends:
        raise InputError(f"{kind} that is cut off, or followed by other data", where=str(path))
    return begin
