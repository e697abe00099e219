"""Say whether drawing or the encoder limits the accuracy of a film's file, and what would make it more exact."""

from __future__ import annotations

from collections.abc import Iterator

from renderer.accuracy import MOST_DB, finer_drawing, finer_than_kept
from renderer.record.film_record import FileAccuracy, FilmRecord
from renderer.scene import FilmScene, OutputFile


def limit_notes(scene: FilmScene, record: FilmRecord) -> Iterator[str]:
    """Yield a sentence that says what limits the accuracy of an encoded film: drawing or the encoder.

    Yields another sentence before it if coarser frames would do, and nothing for numbered image files and for encoders
    without a loss, such as that of APNG.
    scene: the scene of the film, with its goal.
    """
    accuracy = record.accuracy
    if accuracy is None or accuracy.file is None or accuracy.file.psnr_of_encoding >= MOST_DB:
        return
    coarser = finer_than_kept(accuracy.interval[0], accuracy.file.psnr_of_encoding)
    if coarser is not None:
        yield coarser
    if accuracy.psnr < accuracy.file.psnr_of_encoding:
        yield f"drawing limits the file: {_finer_drawing(scene, record, accuracy.psnr, accuracy.file.psnr_of_encoding)}"
    else:
        yield f"the encoder limits the file: {_finer_encoding(scene.output, accuracy.file)}"


def _finer_encoding(output: OutputFile, file: FileAccuracy) -> str:
    """Return a text on the accuracy that another encoding would give, and on its cost in bytes."""
    finer = file.finer
    if finer is None:
        return "no other setting of its encoder gains 1 dB"
    (key, value), *_ = finer.keys.items()
    players = output.chosen_codec.full_chroma_players if key == "pixel_format" else ""
    cost = f"gives PSNR {finer.psnr:.1f} dB, not {file.psnr:.1f}, in {finer.bytes_ratio:.1f} times the bytes"
    return f"{key}: {value if isinstance(value, str) else format(value, 'g')} {cost}" + (players and f"; {players}")


def _finer_drawing(scene: FilmScene, record: FilmRecord, psnr: float, kept: float) -> str:
    """Return a text on the tolerance at which the encoder, not drawing, would limit the film, and on its cost in time.

    psnr: the PSNR of the drawn frames against the truth. kept: the PSNR of the decoded frames against the drawn ones.
    """
    low, high = record.schedule.tolerance
    if high == 0:
        return "its frames have full resolution"
    if scene.needs_opengl or low < high:
        return f"finer tolerances give up to PSNR {kept:.1f} dB"
    finer, times = finer_drawing(high, psnr, kept)
    return f"tolerance {finer:g} gives about PSNR {kept:.0f} dB, in about {times:.2g} times the time"
