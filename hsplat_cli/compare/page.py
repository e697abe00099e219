"""Make the page of a report: all films by verdict, their pictures in step, and decisions on what becomes golden.

The page is opened from an unpacked artifact, without a server: pictures are files beside it, and the data that its
script needs is in the page. The script compares no pixels: browsers keep the pixels of files from scripts.
"""

from __future__ import annotations

import hashlib
import math
import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any
from urllib.parse import quote

from hsplat_cli.compare.difference import PART_PX
from hsplat_cli.compare.outcome import REPORT, VERDICTS, ComparedFilm, ComparedFrame, Comparison, ReportPicture
from hsplat_cli.reports import Axis, Chart, Curve, Tick, render_page, round_numbers
from renderer.accuracy import MOST_DB
from renderer.system import printable

# The frames per second of a film whose rate is not known.
_FRAMES_PER_SECOND = 10.0
# The size of a chart, in pixels.
_CHART_PX = (1000, 240)
# The largest PSNR of charts, in dB, unless a frame has more; equal pictures are drawn a step above it.
_LEAST_TOP_DB = 60.0
# The distance of lines across a chart, in dB.
_STEP_DB = 20.0
# The most numbers along the axis of frames.
_MOST_TICKS = 12
# A colour in the text of a changed value.
_COLOR = re.compile(r"(#[0-9a-f]{6})\b")
# The words for keys that no scene has.
_KEYS = {"volume.fingerprint": "digest of the volume's voxels"}
# The words and marks of verdicts; the mark says the same as the colour.
_MARKS = {"not compared": "!", "fails": "✗", "passes": "✓"}


def report_page(comparison: Comparison) -> str:
    """Return the HTML page of a report; equal outcomes give equal pages."""
    films = [_PageFilm(number, film) for number, film in enumerate(comparison.worst_first)]
    return render_page(
        "comparison.html",
        title=comparison.summary,
        films=films,
        marks=_MARKS,
        counts=[(each, sum(film.outcome.verdict == each for film in films)) for each in VERDICTS],
        part_px=PART_PX,
        data={
            "key": hashlib.blake2b(REPORT.content(comparison), digest_size=16).hexdigest(),
            "partPx": PART_PX,
            "arguments": list(comparison.arguments),
            "films": [film.data for film in films],
        },
    )


@dataclass(frozen=True)
class _PageFilm:
    """A film of the page. number: its index in the page."""

    number: int
    outcome: ComparedFilm

    @property
    def changes(self) -> list[tuple[str, int, list[str], list[str]]]:
        """Return key, line, old and new value of each change; in the pieces of values, each second one is a colour."""
        return [
            (_KEYS.get(change.key, change.key), change.line, _COLOR.split(change.was), _COLOR.split(change.now))
            for change in self.outcome.changes
        ]

    @property
    def facts(self) -> Iterator[tuple[str, str]]:
        """Yield the names and texts of facts about the film."""
        film, origin = self.outcome, self.outcome.origin
        yield "limit", film.limit
        if film.scene:
            yield "scene", film.scene
            yield "goldens", film.goldens
        if origin is not None:
            volume = origin.volume
            yield "volume", f"{volume.name}, {' x '.join(map(str, volume.shape))} voxels of {volume.dtype}"
            yield "drawn by", origin.device
            yield "versions", ", ".join(f"{name} {version}" for name, version in origin.versions.items())

    @cached_property
    def places(self) -> Sequence[int]:
        """Return the places of frames on the axis of the chart: their numbers, if all have one and they ascend, or
        their indices.
        """
        numbers = [frame.frame for frame in self.outcome.frames if frame.frame is not None]
        is_numbered = len(numbers) == len(self.outcome.frames) and numbers == sorted(set(numbers))
        return numbers if is_numbered else range(len(self.outcome.frames))

    @cached_property
    def has_pictures(self) -> bool:
        """Return whether the report has a picture of the film."""
        return any(_address(frame.old) or _address(frame.new) for frame in self.outcome.frames)

    @cached_property
    def chart(self) -> Chart | None:
        """Return the error over the frames; None unless two frames have a figure."""
        return _chart(self) if sum(frame.part_psnr is not None for frame in self.outcome.frames) > 1 else None

    @property
    def data(self) -> dict[str, Any]:
        """Return the values that the script needs."""
        film = self.outcome
        # A command line can hold no name with such characters.
        can_accept = bool(film.scene) and film.verdict == "fails" and printable(film.name) == film.name
        data: dict[str, Any] = {
            "name": film.name,
            "verdict": film.verdict,
            "rate": film.frames_per_second or _FRAMES_PER_SECOND,
            "hasPictures": self.has_pictures,
            "frames": [
                _frame_data(frame, place, can_accept=can_accept)
                for frame, place in zip(film.frames, self.places, strict=True)
            ],
        }
        if self.chart is not None:
            left, right, top, bottom = self.chart.box
            axis = self.chart.x
            data["chart"] = {
                "left": left, "right": right, "top": top, "bottom": bottom, "low": axis.low, "high": axis.high
            }  # fmt: skip
        return data


def _frame_data(frame: ComparedFrame, place: int, *, can_accept: bool) -> dict[str, Any]:
    """Return what the script needs of a frame, without values that are the same for most frames."""
    new = _address(frame.new)
    values = {
        "name": printable(frame.name),
        "place": place,
        "status": frame.status,
        "why": printable(frame.why),
        "fails": not frame.passes,
        "accepts": can_accept and not frame.passes and frame.frame is not None and (bool(new) or frame.is_gone),
        "number": frame.frame,
        "part": frame.part if frame.part_psnr is not None and frame.part_psnr < MOST_DB else None,
        "decibels": None if frame.part_psnr is None else round(frame.part_psnr, 1),
        "whole": None if frame.psnr is None else round(frame.psnr, 1),
        "largest": None if frame.largest is None else round(frame.largest),
        "flip": None if frame.flip is None else round(frame.flip, 4),
        "nearer": frame.nearness,
        "old": _address(frame.old),
        "new": new,
    }
    return {key: value for key, value in values.items() if value is not None and value is not False and value != ""}


def _address(picture: ReportPicture | None) -> str:
    """Return the relative address of a picture's file; empty without one."""
    return "" if picture is None else quote(os.fsencode(picture.file))


def _chart(film: _PageFilm) -> Chart:
    """Lay out the chart of the error over the frames. Equal pictures have no PSNR: they are drawn at `same`."""
    frames = film.outcome.frames
    figures = [
        value
        for frame in frames
        for value in (frame.part_psnr, frame.psnr, frame.least)
        if value is not None and value < MOST_DB
    ]
    top = _STEP_DB * math.ceil(max([*figures, _LEAST_TOP_DB]) / _STEP_DB)
    low = _STEP_DB * math.floor(min([*figures, top - 2 * _STEP_DB]) / _STEP_DB)
    num_steps = round((top - low) / _STEP_DB)
    lines = [low + _STEP_DB * step for step in range(num_steps + 1)]
    same = top + _STEP_DB / 2

    def points(values: Sequence[float | None]) -> list[tuple[float, float] | None]:
        return [
            None if value is None else (place, same if value >= MOST_DB else value)
            for place, value in zip(film.places, values, strict=True)
        ]

    part = f"worst part of {PART_PX} x {PART_PX} pixels"
    limit = f"limit: {film.outcome.limit}"
    return Chart(
        _frame_axis(film),
        # Below the lowest line is room for the bar of the frames that fail.
        Axis(
            "PSNR in dB",
            low - _STEP_DB / 4,
            same + _STEP_DB / 4,
            [*(Tick(at, f"{at:g}") for at in lines), Tick(same, "same")],
        ),
        [
            Curve("whole picture", points([frame.psnr for frame in frames]), "series-8", dash="4 3"),
            Curve(limit, points([frame.least for frame in frames]), "series-2"),
            Curve(part, points([frame.part_psnr for frame in frames]), "series-1", "small circle"),
        ],
        f"{_marks_text(film)}A click shows a frame; dragging selects a run of frames.",
        f"PSNR over the frames of {printable(film.outcome.name)}: {film.outcome.summary}",
        marks=[(film.places[index], f"{_name(film, index)}: {text}") for index, text in _marks(film)],
        size=_CHART_PX,
    )


def _frame_axis(film: _PageFilm) -> Axis:
    first, last = film.places[0], film.places[-1]
    ticks = [Tick(at, f"{at:g}") for at in round_numbers(first, last, _MOST_TICKS, least_step=1.0)]
    return Axis("frame", first - 0.5, last + 0.5, ticks)


def _marks(film: _PageFilm) -> list[tuple[int, str]]:
    """Return the indices of the first and of the worst frame that fails, each with a text; one if they are the same."""
    failing = [(index, frame) for index, frame in enumerate(film.outcome.frames) if not frame.passes]
    if not failing:
        return []
    (first, _), (worst, _) = failing[0], min(failing, key=lambda each: each[1].rank)
    if first == worst:
        return [(first, "the first that fails, and the worst")]
    return [(first, "the first that fails"), (worst, "the worst")]


def _marks_text(film: _PageFilm) -> str:
    """Return a sentence about the marked frames; empty without one."""
    texts = [f"{_name(film, index)}, {text}" for index, text in _marks(film)]
    return f"Crosses mark {'; '.join(texts)}. " if texts else ""


def _name(film: _PageFilm, index: int) -> str:
    return printable(film.outcome.frames[index].name)
