"""Which of drawing and encoder limits a film's file, and which setting would make it more exact."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small_scene import small_tree

from renderer.accuracy import MOST_DB, EncodingErrors, encoding_loss, finer_encoding, psnr, squared_error
from renderer.film import Picture, Pixels, open_films
from renderer.job import try_finer_encoding
from renderer.record import (
    FilmAccuracy,
    FilmRecord,
    FinerFile,
    WorstFrame,
    limit_notes,
    parse_film_record,
    with_encoding_errors,
)
from renderer.scene import OutputFile, parse_scene

SIZE = (48, 32)
Colors = tuple[tuple[int, int, int], tuple[int, int, int]]
SATURATED: Colors = ((255, 0, 0), (0, 0, 255))
GREY: Colors = ((0, 0, 0), (255, 255, 255))
RECORD = Path(__file__).parents[1] / "messages" / "sidecar.json"


def accuracy(decibels: float) -> FilmAccuracy:
    """Return the accuracy of a film whose frames have this PSNR."""
    interval = (decibels - 1, decibels + 1)
    return FilmAccuracy(decibels, interval, 64, WorstFrame(0, decibels, interval), 0.1, "any", 0)


def stripes(colors: Colors) -> list[Pixels]:
    """Return pictures of slanted stripes of two colours."""
    x, y = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
    return [np.array(colors, np.uint8)[(x + y + k) // 3 % 2] for k in range(4)]


def film(folder: Path, **keys: Any) -> tuple[OutputFile, list[Picture], float]:
    """Write a film of saturated stripes; return its output, its pictures and its loss."""
    output = OutputFile(folder / "film.mp4", SIZE, **keys)
    pictures = [Picture(pixels) for pixels in stripes(SATURATED)]
    with open_films([output], [output.kind]) as write:
        for number, picture in enumerate(pictures):
            write(number, {0: picture})
    return output, pictures, encoding_loss(output, 4, [picture.pixels for picture in pictures])


def notes(
    drawn: float, kept: float, finer: FinerFile | None = None, tolerance: tuple[float, float] = (0.5, 0.5), **scene: Any
) -> list[str]:
    """Return what is said of a film whose frames and whose encoder have these PSNR."""
    record = parse_film_record(RECORD.read_bytes(), RECORD)
    assert isinstance(record, FilmRecord)
    made = with_encoding_errors(accuracy(drawn), EncodingErrors(squared_error(kept)), 4, finer)
    record = replace(record, accuracy=made, schedule=replace(record.schedule, tolerance=tolerance))
    return [*limit_notes(parse_scene(small_tree(**scene), base=Path()), record)]


def test_an_encoder_without_a_loss_limits_nothing() -> None:
    assert notes(46.0, MOST_DB) == []


def test_the_encoder_limits_a_film() -> None:
    quality = FinerFile({"quality": 10.0}, 47.1, 1.62)
    assert notes(52.0, 44.0, quality) == [
        "the encoder limits the file: quality: 10 gives PSNR 47.1 dB, not 43.4, in 1.6 times the bytes"
    ]
    chroma = FinerFile({"pixel_format": "yuv444p"}, 50.0, 1.25)
    assert notes(54.7, 35.8, chroma) == [
        "file PSNR about 36 dB, frames PSNR 54 dB before encoding: tolerance 0.3, or psnr 44, gives nearly the same "
        "film sooner",
        "the encoder limits the file: pixel_format: yuv444p gives PSNR 50.0 dB, not 35.7, in 1.2 times the bytes; "
        "Chrome, VLC and mpv play it; Firefox, Safari and most devices do not",
    ]
    assert "; Chrome, Firefox, VLC" in notes(50.0, 40.0, chroma, output={"file": "a.webm"})[0]
    assert notes(50.0, 40.0, chroma, output={"file": "a.avif"})[0].endswith(" times the bytes")
    assert notes(52.0, 44.0) == ["the encoder limits the file: no other setting of its encoder gains 1 dB"]


def test_drawing_limits_a_film() -> None:
    """With 17 dB more for a tenth of the tolerance, 44 + 8 dB need a tenth of that of 35 dB."""
    assert notes(35.0, 44.0) == [
        "drawing limits the file: tolerance 0.05 gives about PSNR 44 dB, in about 5.6 times the time"
    ]
    assert notes(35.0, 44.0, tolerance=(0.1, 0.5)) == [
        "drawing limits the file: finer tolerances give up to PSNR 44.0 dB"
    ]
    assert notes(35.0, 44.0, splat={"footprint": "gaussian"}) == [
        "drawing limits the file: finer tolerances give up to PSNR 44.0 dB"
    ]
    assert notes(35.0, 44.0, tolerance=(0.0, 0.0)) == ["drawing limits the file: its frames have full resolution"]


def test_nothing_is_said_of_frames_and_of_films_without_accuracy() -> None:
    record = parse_film_record(RECORD.read_bytes(), RECORD)
    assert isinstance(record, FilmRecord)
    scene = parse_scene(small_tree(), base=Path())
    assert [*limit_notes(scene, record)] == [*limit_notes(scene, replace(record, accuracy=accuracy(50.0)))] == []


@pytest.mark.parametrize(
    ("keys", "colors", "finer"),
    [
        ({}, SATURATED, {"pixel_format": "yuv444p"}),
        ({}, GREY, {"quality": 10.0}),
        ({"quality": 9.0, "pixel_format": "yuv444p"}, SATURATED, {"quality": 10.0}),
        ({"quality": 10.0}, GREY, {}),
        ({"crf": 20.0}, GREY, {"crf": 14.0}),
        ({"crf": 2.0}, GREY, {"crf": 0.0}),
        ({"crf": 0.0}, GREY, {}),
        ({"codec": "hevc", "pixel_format": "yuv420p10"}, SATURATED, {"quality": 10.0}),
        ({"file": Path("film.webp")}, SATURATED, {"quality": 10.0}),
        ({"file": Path("film.webp"), "codec": "lossless"}, SATURATED, {}),
        ({"file": Path("film.gif")}, SATURATED, {}),
        ({"file": Path("film.webm"), "background": None}, SATURATED, {"quality": 10.0}),
        ({"file": Path("film.avif"), "pixel_format": "yuv420p"}, SATURATED, {"pixel_format": "yuv444p"}),
    ],
)
def test_which_key_lets_a_file_keep_more(keys: Mapping[str, Any], colors: Colors, finer: Mapping[str, Any]) -> None:
    """Chroma of half the resolution loses edges between saturated colours, and none between greys."""
    output = OutputFile(**{"file": Path("film.mp4"), **keys})
    assert finer_encoding(output, stripes(colors), 1e-3) == finer


def test_chroma_is_to_blame_for_its_share_of_the_loss_alone() -> None:
    output, frames = OutputFile(Path("film.mp4"), SIZE), stripes(SATURATED)
    assert finer_encoding(output, frames, 0.99) == {"quality": 10.0}
    # Alpha of films that have it is no colour.
    clear = [np.dstack([np.zeros_like(frame), frame[..., 0]]) for frame in frames]
    assert finer_encoding(output, clear, 1e-3) == {"quality": 10.0}


def test_full_chroma_is_measured_on_the_same_pictures(tmp_path: Path) -> None:
    drawn = accuracy(50.0)
    output, pictures, loss = film(tmp_path)
    finer = try_finer_encoding(output, pictures, len(pictures), EncodingErrors(loss), drawn)
    # Of a longer film, the first pictures are encoded again, to compare the bytes.
    assert finer == try_finer_encoding(output, pictures, len(pictures) + 1, EncodingErrors(loss), drawn)
    _, _, full = film(tmp_path, pixel_format="yuv444p")
    assert finer is not None and finer.keys == {"pixel_format": "yuv444p"}
    assert finer.psnr == pytest.approx(psnr(full + squared_error(50.0)), abs=0.01)
    num_bytes = output.file.stat().st_size
    _ = film(tmp_path)
    assert finer.bytes_ratio == pytest.approx(num_bytes / output.file.stat().st_size, abs=0.01)


def test_no_trial_where_drawing_limits_or_nothing_gains(tmp_path: Path) -> None:
    output, pictures, loss = film(tmp_path)
    assert try_finer_encoding(output, pictures, len(pictures), EncodingErrors(loss), accuracy(psnr(loss) - 0.1)) is None
    finest = replace(output, quality=10.0, pixel_format="yuv444p")
    assert try_finer_encoding(finest, pictures, len(pictures), EncodingErrors(loss), accuracy(50.0)) is None
    # Of an encoder that loses less than a decibel, the trial gains less, too.
    drawn = accuracy(psnr(loss) + 0.1)
    _, _, full = film(tmp_path, pixel_format="yuv444p")
    gained = psnr(full + squared_error(drawn.psnr)) - psnr(2 * loss)
    assert (try_finer_encoding(output, pictures, len(pictures), EncodingErrors(loss), drawn) is not None) == (
        gained > 1
    )


def test_a_trial_that_fails_costs_no_film(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    output, pictures, loss = film(tmp_path)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "missing"))
    assert try_finer_encoding(output, pictures, len(pictures), EncodingErrors(loss), accuracy(50.0)) is None
