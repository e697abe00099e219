"""Write finished frames to films and numbered files, each of them completely or not at all."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping, Sequence

from renderer.film.atomic import staging, translate_os_errors
from renderer.film.encode import frame_rate, open_encoder, require_codec
from renderer.film.exr import require_openexr
from renderer.film.names import frame_path, unfinished_folder
from renderer.film.picture import Picture
from renderer.scene import OutputFile, OutputSpec, PictureKind

# A function that writes a frame. It takes the number of the frame, and a mapping from the index of each kind of picture
# to the frame's picture of that kind.
WriteFrame = Callable[[int, Mapping[int, Picture]], None]


def require_encoder(output: OutputSpec) -> None:
    """Raise RenderError, or InputError, if an output needs an encoder that is missing."""
    for each in output.files:
        if not each.is_frames:
            require_codec(each)
        elif each.kind.depth == 32:
            require_openexr()


@contextlib.contextmanager
def open_films(
    outputs: Sequence[OutputFile],
    kinds: Sequence[PictureKind],
    *,
    is_locked: bool = False,
    before_rename: Callable[[], None] = lambda: None,
) -> Iterator[WriteFrame]:
    """Yield a function that writes the next frame to all outputs that show it.

    Files get their final names at the end of the block, one by one, when all are written. If the block raises, nothing
    is written. Films wait for the disk before they are renamed. Frames in files do not, as their digests show damage.

    kinds: the kinds of pictures (size, background, depth) of all outputs of the scene, by their indices.
    is_locked: whether the outputs have folders for unfinished work, in which incomplete files lie; otherwise incomplete
        files lie beside the outputs.
    before_rename: a function that is called when everything is written, before files get their final names.
    """
    films = [each for each in outputs if not each.is_frames]
    folders = {each.file: unfinished_folder(each) if is_locked else None for each in outputs}
    with staging(is_durable=bool(films)) as stage:
        with contextlib.ExitStack() as stack:
            encoders = {
                each.file: stack.enter_context(open_encoder(each, stage(each.file, folders[each.file])))
                for each in films
            }

            def write(frame: int, pictures: Mapping[int, Picture]) -> None:
                for each in (each for each in outputs if each.shows(frame)):
                    picture, path = pictures[kinds.index(each.kind)], frame_path(each.file, frame)
                    if each.file in encoders:
                        encoders[each.file](picture.pixels)
                        continue
                    with translate_os_errors(path):
                        stage(path, folders[each.file]).write_bytes(picture.content)

            yield write
        before_rename()


def film_notes(output: OutputSpec) -> list[str]:
    """Return notes on formats that cannot have the frame rate or the dpi, and on outputs smaller than the first."""
    notes = [output.dpi_note] if output.dpi_note is not None else []
    for each in output.files:
        rate = frame_rate(each)
        if each.format.ticks_per_second and abs(rate - each.frames_per_second) >= 0.005:
            shown = f"{float(rate):.2f} frames per second, not {each.frames_per_second:g}"
            notes.append(f"a GIF shows each frame for whole hundredths of a second: {shown}")
    for each in output.others:
        if each.size != output.size:
            factor = output.size[0] // each.size[0]
            notes.append(f"{each.file.name}: each pixel is the mean of {factor} x {factor} pixels")
    return notes
