"""Encode some pictures of a film in a temporary folder, to predict its bytes or to find an encoding that loses less."""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from renderer.accuracy import EncodingErrors, encoding_loss, finer_encoding, squared_error
from renderer.errors import HsplatError
from renderer.film import Picture, open_films
from renderer.record import FilmAccuracy, FinerFile, finer_file
from renderer.scene import OutputFile


@contextlib.contextmanager
def trial_film(output: OutputFile, pictures: Sequence[Picture]) -> Iterator[OutputFile]:
    """Write a film of these pictures to a temporary folder, and yield the output with the path of this trial film."""
    with tempfile.TemporaryDirectory(prefix="hsplat-") as folder:
        film = replace(output, file=Path(folder) / output.file.name, every=1, frame=None)
        with open_films([film], [film.kind]) as write:
            for number, picture in enumerate(pictures):
                write(number, {0: picture})
        yield film


def film_bytes(film: OutputFile) -> int:
    """Return the bytes of all files in the folder of a trial film, which has no other files."""
    return sum(file.stat().st_size for file in film.file.parent.iterdir())


def try_finer_encoding(
    output: OutputFile, pictures: Sequence[Picture], num_frames: int, errors: EncodingErrors, accuracy: FilmAccuracy
) -> FinerFile | None:
    """Return the record of an encoding that loses less than that of the film.

    None if drawing loses more than the encoder, or if no setting of the encoder loses less.

    pictures: the first pictures of the film, which are encoded in both ways. num_frames: the number of frames of the
    film, which is there. errors: the errors that the film's encoding adds to the pictures.
    """
    loss = errors.loss
    if loss <= squared_error(accuracy.psnr):
        return None
    frames = [picture.pixels for picture in pictures]
    keys = finer_encoding(output, frames, loss)
    if not keys:
        return None
    # If the trial fails, because the disk is full or ffmpeg lacks the pixel format, the film is made all the same.
    with contextlib.suppress(HsplatError, OSError):
        finer = replace(output, **keys)
        if len(pictures) == num_frames:  # the film itself has these pictures and no others
            num_bytes = output.file.stat().st_size
        else:
            with trial_film(output, pictures) as film:
                num_bytes = film_bytes(film)
        with trial_film(finer, pictures) as film:
            finer_loss = encoding_loss(film, len(frames), frames)
            return finer_file(accuracy, keys, (errors, errors.at_loss(finer_loss)), film_bytes(film) / num_bytes)
    return None
