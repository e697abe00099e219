"""Define the outcome of a comparison: of a frame, of a film, of all films. They are the content of report.json, too.

A film is a scene whose frames were drawn and compared with its goldens, or a set of existing pictures.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Literal

from hsplat_cli.compare.golden.record import Origin
from renderer.accuracy import MOST_DB
from renderer.record import RecordFile, field_types as types
from renderer.scene import counted, schema

# `same`: no stored value differs. `close`: the difference is within the limit. A frame of any other status fails.
Status = Literal["same", "close", "different", "missing", "new", "other size", "other channels"]
_PASSES = ("same", "close")
# The statuses in the words and in the order of summaries.
_WORDS: dict[Status, str] = {
    "different": "different",
    "missing": "missing",
    "new": "without a golden",
    "other size": "of another size",
    "other channels": "with other channels",
    "same": "the same",
    "close": "close",
}

# The most changes of a scene that a text names.
MOST_CHANGES = 8

# The verdict on a film, the worst first. `not compared`: an error kept it from being compared.
Verdict = Literal["not compared", "fails", "passes"]
VERDICTS: tuple[Verdict, ...] = ("not compared", "fails", "passes")


@dataclass(frozen=True)
class ReportPicture:
    """A picture of a frame in a report.

    digest: the digest of its pixels. file: its path in the folder of the report; empty if the report lacks it.
    psnr: the accuracy that it states, in dB, if it states one.
    """

    digest: Annotated[str, types.DIGEST]
    file: str = ""
    psnr: Annotated[float | None, types.DECIBELS] = None


@dataclass(frozen=True)
class Nearness:
    """The PSNR of a golden and of the new picture against the exact picture of the scene as it is now, in dB.

    Both are measured at the same pixels. differs: whether one of them is surely nearer.
    """

    old: Annotated[float, types.DECIBELS]
    new: Annotated[float, types.DECIBELS]
    differs: bool = False


@dataclass(frozen=True)
class ComparedFrame:
    """The outcome of one frame.

    name: the name of the file, or `frame 12`. why: the reason, in one sentence. frame: its number, if it has one.
    psnr, part_psnr, part, largest: as in Figures; None if nothing can be compared. least: the lowest PSNR that passes.
    flip: the mean FLIP. nearer: of some failing frames. golden: the number of the golden that it was compared with.
    old, new: the pictures.
    """

    name: str
    status: Status
    why: str
    frame: Annotated[int | None, types.COUNT] = None
    psnr: Annotated[float | None, types.DECIBELS] = None
    part_psnr: Annotated[float | None, types.DECIBELS] = None
    part: Annotated[tuple[int, int] | None, schema.sequence_field(types.COUNT, "[x, y]", count=2)] = None
    largest: Annotated[float | None, types.AMOUNT] = None
    least: Annotated[float | None, types.DECIBELS] = None
    flip: Annotated[float | None, types.AMOUNT] = None
    nearer: Nearness | None = None
    golden: Annotated[int, types.COUNT] = 1
    old: ReportPicture | None = None
    new: ReportPicture | None = None

    @property
    def passes(self) -> bool:
        """Return whether the frame is within its limit."""
        return self.status in _PASSES

    @property
    def is_gone(self) -> bool:
        """Return whether the film does not have this frame any more: accepting that removes its golden."""
        return self.status == "missing" and self.new is None

    @property
    def nearness(self) -> str:
        """Return in words which picture is nearer to the exact one; an empty text if it was not measured."""
        if self.nearer is None:
            return ""
        old, new = self.nearer.old, self.nearer.new
        figures = f"the golden has {_exactness(old)} of the exact picture, the new one {_exactness(new)}"
        if not self.nearer.differs:
            return f"not known whether nearer to the exact picture: {figures}, by too few rays to be sure"
        return f"{'nearer to' if new > old else 'further from'} the exact picture: {figures}"

    @property
    def rank(self) -> tuple[bool, float]:
        """Return a sort key, worst first: failing frames before passing ones, then by the PSNR of the worst part."""
        return self.passes, -1.0 if self.part_psnr is None else self.part_psnr


def _exactness(psnr: float) -> str:
    """Return the PSNR of a picture against the exact one as text; it is MOST_DB if no probe shows an error."""
    return f"{psnr:.1f} dB" if psnr < MOST_DB else f"{MOST_DB:.0f} dB or more"


@dataclass(frozen=True)
class Change:
    """A key of a scene, or of the volume, whose value is another one than in the goldens.

    was, now: the values as text; empty for a missing value. line: the line of the key in the file of the scene; 0 if it
    is not there.
    """

    key: str
    was: str = ""
    now: str = ""
    line: Annotated[int, types.COUNT] = 0

    @property
    def words(self) -> str:
        """Return the change in words: `error.tolerance was 0.1, is 0.2`."""
        if self.key == "volume.fingerprint":
            return "the voxels of the volume changed"
        return f"{self.key} was {self.was or 'not there'}, is {self.now or 'gone'}"


@dataclass(frozen=True)
class Mistake:
    """A mistake in the file of a scene, which keeps the film from being compared. line: its line."""

    text: str
    line: Annotated[int, types.COUNT]


@dataclass(frozen=True)
class Flickers:
    """The flicker of the new pictures, and of the goldens if it is known, in levels of 8 bits, 0 to 255."""

    new: Annotated[float, types.AMOUNT]
    old: Annotated[float | None, types.AMOUNT] = None


@dataclass(frozen=True)
class ComparedFilm:
    """The outcome of one film.

    name: the name of the film: the path of its scene in the project, without a suffix. limit: the limit, as text.
    scene, goldens: the scene's file and the folder of its goldens, relative to the project; empty for pictures.
    error: why it was not compared. mistakes: those of the scene, if they are the reason. changes: the keys in which
    scene, volume, device and versions differ from those of the goldens. notes: notes for the user. origin: what drew
    the new frames. frames_per_second: the rate of the scene's film, if it is known. flicker: between neighbouring
    frames, if they were drawn. frames: the frames, in their order.
    """

    name: str
    limit: str
    scene: str = ""
    goldens: str = ""
    error: str = ""
    mistakes: tuple[Mistake, ...] = ()
    changes: tuple[Change, ...] = ()
    notes: tuple[str, ...] = ()
    origin: Origin | None = None
    frames_per_second: Annotated[float | None, types.AMOUNT] = None
    flicker: Flickers | None = None
    frames: tuple[ComparedFrame, ...] = ()

    @property
    def failing(self) -> list[ComparedFrame]:
        """Return the frames that fail, the worst first."""
        return sorted((frame for frame in self.frames if not frame.passes), key=lambda frame: frame.rank)

    @property
    def verdict(self) -> Verdict:
        """Return the verdict: a film without any compared frame does not pass."""
        if self.error or not self.frames:
            return "not compared"
        return "fails" if self.failing else "passes"

    @property
    def summary(self) -> str:
        """Return the verdict in one line: `3 of 48 frames fail: 2 different, 1 missing, 45 the same`."""
        if self.verdict == "not compared":
            return self.error or "no frame was compared"
        counts = Counter(frame.status for frame in self.frames)
        parts = ", ".join(f"{counts[status]} {words}" for status, words in _WORDS.items() if counts[status])
        num, num_failing = len(self.frames), len(self.failing)
        if num_failing:
            return f"{num_failing} of {counted(num, 'frame')} {'fails' if num_failing == 1 else 'fail'}: {parts}"
        return f"{counted(num, 'frame')} {'passes' if num == 1 else 'pass'}: {parts}"


@dataclass(frozen=True)
class Comparison:
    """The outcome of a comparison: the content of report.json.

    films: at least one, in the order of their names. arguments: the words of a command line by which `hsplat golden`
    finds the same scenes and goldens in the same folder; none for those of its golden.yaml.
    """

    films: tuple[ComparedFilm, ...]
    arguments: tuple[str, ...] = ()

    @property
    def verdict(self) -> Verdict:
        """Return the worst verdict on a film."""
        return min((film.verdict for film in self.films), key=VERDICTS.index)

    @cached_property
    def worst_first(self) -> list[ComparedFilm]:
        """Return the films by verdict, then by their worst frame."""

        def rank(film: ComparedFilm) -> tuple[int, float]:
            worst = min((frame.rank[1] for frame in film.failing), default=0.0)
            return VERDICTS.index(film.verdict), worst

        return sorted(self.films, key=rank)

    @property
    def summary(self) -> str:
        """Return the verdict on all films in one line."""
        if len(self.films) == 1:
            return self.films[0].summary
        counts = Counter(film.verdict for film in self.films)
        words = {"not compared": "could not be compared", "fails": "fail", "passes": "pass"}
        parts = ", ".join(f"{counts[verdict]} {words[verdict]}" for verdict in VERDICTS if counts[verdict])
        return f"{counted(len(self.films), 'film')}: {parts}"


REPORT = RecordFile(
    schema.dataclass_field(Comparison),
    noun="a report of a comparison",
    max_bytes=2**28,
    format_line="hsplat comparison 1",
    hint="the version of hsplat that compared can read it",
    lined="films",
)
