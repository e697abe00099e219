"""The record of a film, which its sidecar stores: dataclasses, written to JSON and read back.

Each field declares its type and a sentence about it, from which reading, messages and docs/sidecar.md follow. Anybody
may have edited a sidecar: reading checks everything, and says where a mistake is.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, dataclass, fields, is_dataclass
from pathlib import Path
from typing import Annotated, Any

from renderer.accuracy import MOST_DB
from renderer.errors import InputError, Problem
from renderer.scene import (
    ERROR_SECTION,
    MAX_FRAMES,
    MAX_SIDECAR_BYTES,
    ErrorSpec,
    PictureKind,
    check_frame_in_path,
    check_frames_ascend,
    decode_utf8,
    format_value,
    is_shallow,
    load_json_object,
    may_be_json,
    raise_problems,
    schedule_to_dict,
    schema,
)

FORMAT = "hsplat film 2"

# No measured value comes near it, and sums over all parts of a film stay finite.
_MAX_AMOUNT = 1e100
# More levels than any scene or fingerprint has.
_MOST_LEVELS = 12
_DIGEST = re.compile("[0-9a-f]{32}")
# Keys of records before they had a format, and their names now.
_FORMER_KEYS = {"cause": "fingerprint", "gl": "device"}


# Types of fields. JSON has numbers, so text that spells one is refused.


def _number(expected: str, kinds: tuple[type, ...], least: float, most: float) -> schema.FieldType[Any]:
    def parse(node: schema.TreeNode) -> Any:
        value: Any = node.value
        if type(value) not in kinds:
            return node.reject("not a whole number" if kinds == (int,) else "not a number")
        return value if least <= value <= most else node.reject("out of range")

    return schema.FieldType(expected, parse)


def _parse_shallow(node: schema.TreeNode) -> Any:
    """Parse data that is copied as it is."""
    if not isinstance(node.value, dict) or is_shallow(node.value, _MOST_LEVELS):
        return schema.MAPPING_FIELD.parse(node)
    return node.reject("too many levels", got="", expected=f"at most {_MOST_LEVELS}")


def _parse_scene(node: schema.TreeNode) -> Any:
    """Parse a recorded scene, which is checked where it is used; paths are taken from these sections anywhere."""
    scene = _parse_shallow(node)
    if scene is schema.INVALID:
        return scene
    of_volumes = {"volumes": _MAPPINGS} if "volumes" in scene else {"volume": schema.MAPPING_FIELD}
    of_outputs = _MAPPINGS if isinstance(scene.get("output"), list) else schema.MAPPING_FIELD
    for section, field in {**of_volumes, "output": of_outputs}.items():
        if section in scene:
            field.read(node.child(section, scene[section]))
        else:
            field.reject(node.child(section), "missing")
    return scene


_MAPPINGS = schema.sequence_field(schema.MAPPING_FIELD, "a list of mappings")


DIGEST_FIELD = schema.text_field("32 hexadecimal digits", "not a digest", _DIGEST.fullmatch)
_AMOUNT = _number(f"a number from 0 to {_MAX_AMOUNT:g}", (int, float), 0, _MAX_AMOUNT)
_COORDINATE = _number("a number", (int, float), -_MAX_AMOUNT, _MAX_AMOUNT)
_DECIBELS = _number(f"a number from -{MOST_DB:g} to {MOST_DB:g}", (int, float), -MOST_DB, MOST_DB)
_COUNT = _number("a whole number of at least 0", (int,), 0, 2**63 - 1)
_FRAME_NUMBER = _number(f"a whole number from 0 to {MAX_FRAMES - 1}", (int,), 0, MAX_FRAMES - 1)
_DIGESTS = schema.mapping_field(DIGEST_FIELD)
_AMOUNTS, _TEXTS = schema.mapping_field(_AMOUNT), schema.mapping_field(schema.TEXT_FIELD)
_RANGE = schema.sequence_field(_AMOUNT, "[smallest, largest]", count=2)
_INTERVAL = schema.sequence_field(_DECIBELS, "[low, high]", count=2)
_SHARES = schema.sequence_field(_AMOUNT, "a list of numbers", may_be_empty=True)
_VECTOR = schema.sequence_field(_COORDINATE, "[x, y, z]", count=3)
_SHAPE = schema.sequence_field(_COUNT, "[x, y, z]", count=3)
_MATRIX = schema.sequence_field(schema.sequence_field(_COORDINATE, "four numbers", count=4), "a 4 x 4 matrix", count=4)
_DATA: schema.FieldType[Any] = schema.FieldType("a mapping", _parse_shallow)
_SCENE: schema.FieldType[Any] = schema.FieldType("a mapping", _parse_scene)
_FORMAT = schema.text_field(FORMAT, "another format of records", FORMAT.__eq__)

Range = tuple[float, float]
Amounts = Mapping[str, float]


# Frames


@dataclass(frozen=True)
class FrameAccuracy:
    """A record of how exact a frame is, by exact rays through some of its pixels."""

    psnr: Annotated[
        float, _DECIBELS, "In decibels, of the picture after rounding; 200 where the error is too small to be seen."
    ]
    interval: Annotated[Range, _INTERVAL, "Between these it lies in 95 % of cases, or more; up to 200: at least."]
    rays: Annotated[int, _COUNT, "The pixels that were probed, each by several rays."]
    variance: Annotated[float, _AMOUNT, "Of the squared errors of these, each weighted by the chance of its pixel."]
    largest: Annotated[float, _AMOUNT, "The largest magnitude of these, which chance may bring below 0."]
    largest_error: Annotated[float, _AMOUNT, "The largest error seen of a channel, in [0, 1]; too large at edges."]
    mean: Annotated[float | None, _COORDINATE, "The mean of the squared errors; that of the PSNR if left out."] = None


@dataclass(frozen=True)
class FrameRecord:
    """A record of one frame: what was drawn, and what it cost."""

    frame: Annotated[int, _FRAME_NUMBER, "Its number on the camera's path."]
    tolerance: Annotated[float, _AMOUNT, "The tolerance of its cut."]
    cells: Annotated[int, _COUNT, "The cells of the cut, each a brick or a splat."]
    primitives: Annotated[int, _COUNT, "Those cells that the view can show, which are drawn."]
    seconds: Annotated[Amounts, _AMOUNTS, "The time of each step; `encode` is to write and encode the picture."]
    digest: Annotated[str | None, DIGEST_FIELD, "The digest of its file."] = None
    digests: Annotated[Mapping[str, str] | None, _DIGESTS, "Those of its pictures for other outputs."] = None
    predicted_seconds: Annotated[float | None, _AMOUNT, "The time predicted for it, on a budget of time."] = None
    device: Annotated[str | None, "What drew it, where that was on a cluster."] = None
    blank: Annotated[bool, "True where nothing of the volume shows."] = False
    values: Annotated[Mapping[str, Any] | None, _DATA, "The values of what moves, by their keys in the scene."] = None
    accuracy: Annotated[FrameAccuracy | None, "How exact its picture is, where rays have measured it."] = None
    visible: Annotated[
        tuple[float, ...], _SHARES, "What each of the film's ranges of scalars adds to its mean opacity."
    ] = ()

    def digest_of(self, kind: PictureKind) -> str | None:
        """Return the digest of its picture of a kind; of one that is not recorded, that of the first."""
        return (self.digests or {}).get(kind.name, self.digest)

    @property
    def total_seconds(self) -> float:
        """Return the seconds from the start of the frame until the encoder had it."""
        return float(sum(self.seconds.values()))


_FRAME = schema.dataclass_field(FrameRecord)


def read_frame_record(value: Any) -> FrameRecord | None:
    """Return the record of a frame in plain data; None where it is none."""
    problems: list[Problem] = []
    record: FrameRecord = _FRAME.read(schema.TreeNode(value, "", problems))
    return None if problems else record


def _parse_frames(node: schema.TreeNode) -> Any:
    """Parse the records of all frames; report the first wrong one alone: others may have the same mistake."""
    if not isinstance(node.value, list):
        return node.reject("not a list")
    if not node.value:
        return node.reject("empty", got="")
    found: list[FrameRecord] = []
    for index, value in enumerate(node.value):
        child, num_problems = node.child(index, value), len(node.problems)
        record = _FRAME.read(child)
        if len(node.problems) > num_problems:
            return schema.INVALID
        if found and not check_frames_ascend(child.child("frame"), found[-1].frame, record.frame):
            return schema.INVALID
        found.append(record)
    return tuple(found)


_FRAMES: schema.FieldType[Any] = schema.FieldType("a list of one or more records of frames", _parse_frames)


# Parts of a film's record


@dataclass(frozen=True)
class VolumeRecord:
    """A record of the volume that was drawn."""

    name: Annotated[str, "The name of its file, or of its formula."]
    fingerprint: Annotated[str, DIGEST_FIELD, "The digest of its voxels and their place in the world."]
    dtype: Annotated[str, "The type of its voxels."]
    shape: Annotated[tuple[int, int, int], _SHAPE, "Its voxels along x, y and z."]
    world_from_index: Annotated[tuple[tuple[float, ...], ...], _MATRIX, "From voxel indices to the world, 4 x 4."]
    unit: Annotated[str, "Of lengths in the world, where it is known."] = ""


@dataclass(frozen=True)
class CameraRecord:
    """A record of where the camera was."""

    target: Annotated[tuple[float, ...], _VECTOR, "The world position that it looks at."]
    distance: Annotated[float, _AMOUNT, "From the eye to the target, in world units."]


@dataclass(frozen=True)
class PyramidRecord:
    """A record of the pyramid of averages and errors."""

    levels: Annotated[int, _COUNT, "Its levels above the voxels."]
    bytes: Annotated[int, _COUNT, "Its memory."]
    finest_level_drawn: Annotated[int, _COUNT, "The level of the smallest cells that could be drawn."]


@dataclass(frozen=True)
class MeasuredRecord:
    """A record of the search for the tolerance of an accuracy."""

    metric: Annotated[str, "What was measured: `psnr` or `rmse`."]
    frame: Annotated[int, _FRAME_NUMBER, "The probe frame with the worst value."]
    probes: Annotated[tuple[Annotated[int, _FRAME_NUMBER], ...], "All probe frames."]
    worst: Annotated[float | None, _AMOUNT, "The worst value; left out for the PSNR of equal pictures."] = None


@dataclass(frozen=True)
class ScheduleRecord:
    """A record of the accuracy that was requested and reached."""

    requested: Annotated[ErrorSpec, ERROR_SECTION, "The accuracy, as a section `error` of a scene."]
    tolerance: Annotated[Range, _RANGE, "The smallest and the largest tolerance of a frame."]
    cells: Annotated[Range, _RANGE, "The smallest and the largest number of cells of a frame."]
    met: Annotated[bool, "Whether what was requested was reached."]
    reproducible: Annotated[bool, "False where the tolerances depend on the speed of the machine."]
    shortfall: Annotated[str | None, "What was not reached."] = None
    measured: Annotated[MeasuredRecord | None, "The search for an accuracy."] = None
    made_from: Annotated[str | None, "The sidecar of the film that this one was made again from."] = None


@dataclass(frozen=True)
class WorstFrame:
    """A record of the frame that is the least exact by its own rays."""

    frame: Annotated[int, _FRAME_NUMBER, "Its number."]
    psnr: Annotated[float, _DECIBELS, "In decibels."]
    interval: Annotated[Range, _INTERVAL, "Between these it lies in 95 % of cases, or more."]


@dataclass(frozen=True)
class FileAccuracy:
    """A record of what an encoder has kept of the frames."""

    psnr: Annotated[float, _DECIBELS, "In decibels, of the film as it is decoded, from the exact pictures."]
    psnr_of_encoding: Annotated[float, _DECIBELS, "The same from the frames as they were drawn."]
    frames: Annotated[int, _COUNT, "The frames that were decoded and compared, the first ones."]


@dataclass(frozen=True)
class FilmAccuracy:
    """A record of how exact the frames of a film are together, by their rays."""

    psnr: Annotated[float, _DECIBELS, "In decibels, of their mean squared error."]
    interval: Annotated[Range, _INTERVAL, "Between these it lies in 95 % of cases, or more; up to 200: at least."]
    rays: Annotated[int, _COUNT, "The pixels that were probed in all frames."]
    worst: Annotated[WorstFrame, "The least exact frame."]
    largest_error: Annotated[float, _AMOUNT, "The largest error seen of a channel, in [0, 1]; too large at edges."]
    method: Annotated[str, "How the pixels of the rays were chosen."]
    seed: Annotated[int, _COUNT, "Of their choice, beside the number of the frame."]
    file: Annotated[FileAccuracy | None, "What a film in one file keeps of them; PNG files keep all."] = None


@dataclass(frozen=True)
class VisibleRange:
    """A record of what the scalars of a range show of all that is visible."""

    share: Annotated[float, _AMOUNT, "The sum of transmittance times opacity; the shares of all ranges add up to 1."]
    opacity: Annotated[float, _AMOUNT, "Its largest opacity, per unit of the transfer function."]
    low: Annotated[float | None, _COORDINATE, "Its smallest scalar; left out where there is none."] = None
    high: Annotated[float | None, _COORDINATE, "The scalar at which it ends; left out where there is none."] = None
    name: Annotated[str | None, "Of labels: which they are; their values lie between the two."] = None
    layer: Annotated[int | None, _COUNT, "Of several volumes, which one, from 0."] = None


@dataclass(frozen=True)
class OutputRecord:
    """A record of a further file of the same drawing."""

    file: Annotated[str, "Its name, or the template of its frames, relative to the sidecar."]
    frames: Annotated[int, _COUNT, "Its frames."]
    digest: Annotated[str | None, DIGEST_FIELD, "The digest of a film in one file."] = None
    psnr_of_encoding: Annotated[
        float | None, _DECIBELS, "In decibels, of its first frames as they are decoded from those as they were drawn."
    ] = None


@dataclass(frozen=True)
class FilmVisibility:
    """A record of which scalars the pictures of a film show: its visibility histogram, by the rays of its accuracy."""

    coverage: Annotated[float, _AMOUNT, "The mean opacity of the pictures."]
    ranges: Annotated[
        tuple[VisibleRange, ...],
        "Between control points of the transfer function, at most 12, or 48 of labels; several volumes share these.",
    ]


@dataclass(frozen=True)
class DifferenceRecord:
    """A record of how much a pass changed."""

    rmse: Annotated[float, _AMOUNT, "The root mean square change of pixels and channels in [0, 1]."]
    frames: Annotated[int, _COUNT, "The frames that were compared."]
    psnr_db: Annotated[float | None, _COORDINATE, "The same in decibels; left out where nothing changed."] = None


@dataclass(frozen=True)
class PassRecord:
    """A record of one pass of a progressive film."""

    tolerance: Annotated[Range, _RANGE, "The smallest and the largest tolerance of a frame."]
    cells: Annotated[Range, _RANGE, "The smallest and the largest number of cells of a frame."]
    predicted_seconds: Annotated[float, _AMOUNT, "The time that was predicted for it."]
    seconds: Annotated[float, _AMOUNT, "The time that it took."]
    after_seconds: Annotated[float, _AMOUNT, "When it was finished, from the start of the job."]
    difference: Annotated[DifferenceRecord | None, "From the pass before."] = None


@dataclass(frozen=True)
class PartRecord:
    """A record of a part that a film was assembled from."""

    sidecar: Annotated[str, "The sidecar of the part, relative to this one."]
    frames: Annotated[Range, _RANGE, "The first and the last frame that was taken."]
    num_frames: Annotated[int, _COUNT, "The number of frames that were taken."]
    seconds: Annotated[Amounts, _AMOUNTS, "What the part took."]
    measured: Annotated[MeasuredRecord | None, "The search for an accuracy."] = None


@dataclass(frozen=True)
class BrickMemoryRecord:
    """A record of the memory of bricks, on which no byte of a picture depends."""

    needed: Annotated[int, _COUNT, "Bytes of all visible bricks: where they exceed the limit, some are made again."]
    limit: Annotated[int, _COUNT, "The most bytes that bricks could take, by `--memory` or by what was free."]


@dataclass(frozen=True)
class FilmFingerprint:
    """A fingerprint of a film: what it depends on, besides the numbers of its frames."""

    frames_digest: Annotated[str, DIGEST_FIELD, "The digest of `depends_on`."]
    encoding: Annotated[Mapping[str, Any], _DATA, "How the frames were encoded."]
    depends_on: Annotated[Mapping[str, Any], _DATA, "Scene, voxels, versions and device that the frames depend on."]


@dataclass(frozen=True)
class FilmRecord:
    """A record of how a film was made, and what it cost: the content of its sidecar."""

    scene: Annotated[
        Mapping[str, Any],
        _SCENE,
        "A scene that draws the same frames, with every default; its files are relative to the sidecar.",
    ]
    volume: Annotated[VolumeRecord, "The volume; of several, the first, with the digest of all their fingerprints."]
    camera: Annotated[CameraRecord, "The camera."]
    pyramid: Annotated[PyramidRecord, "The pyramid."]
    device: Annotated[str, "What drew the frames: device and driver of OpenGL for splats, the processor for bricks."]
    versions: Annotated[Mapping[str, str], _TEXTS, "Versions of Python, hsplat and the packages that bytes depend on."]
    schedule: Annotated[ScheduleRecord, "The accuracy."]
    notes: Annotated[tuple[str, ...], "What the user should know."]
    seconds: Annotated[Amounts, _AMOUNTS, "The time of each step of the whole film."]
    frames: Annotated[tuple[FrameRecord, ...], _FRAMES, "The frames, ascending."]
    accuracy: Annotated[FilmAccuracy | None, "How exact the frames are, where rays have measured all of them."] = None
    visibility: Annotated[FilmVisibility | None, "Which scalars the pictures show, where rays have told."] = None
    volumes: Annotated[tuple[VolumeRecord, ...], "Each volume, of several."] = ()
    memory: Annotated[BrickMemoryRecord | None, "The memory of bricks, where one process drew."] = None
    passes: Annotated[tuple[PassRecord, ...], "Passes of a progressive film."] = ()
    parts: Annotated[tuple[PartRecord, ...], "Parts of an assembled film."] = ()
    fingerprint: Annotated[FilmFingerprint | None, "Left out where one pass would not have made this film."] = None
    digest: Annotated[str | None, DIGEST_FIELD, "The digest of a film in one file."] = None
    outputs: Annotated[tuple[OutputRecord, ...], "Further files of the same drawing."] = ()
    format: Annotated[str, _FORMAT, "The version of this format."] = FORMAT

    @property
    def numbers(self) -> tuple[int, ...]:
        """Return the numbers of the frames, ascending."""
        return tuple(record.frame for record in self.frames)


# The frames, of which there are many, come last in the file.
_LAST = "frames"
_FILM = schema.dataclass_field(FilmRecord)


# To JSON and back


def record_to_json(record: Any) -> dict[str, Any]:
    """Return a record as plain data for JSON; fields that have their defaults are left out, but for the format."""
    pairs = ((field, getattr(record, field.name)) for field in fields(record))
    found = {field.name: _plain(value) for field, value in pairs if field.default is MISSING or value != field.default}
    if not isinstance(record, FilmRecord):
        return found
    frames = found.pop(_LAST)
    return {"format": record.format, **found, _LAST: frames}


def _plain(value: Any) -> Any:
    if isinstance(value, ErrorSpec):
        return schedule_to_dict(value)
    if is_dataclass(value):
        return record_to_json(value)
    return [_plain(item) for item in value] if isinstance(value, (tuple, list)) else value


def record_from_json(data: Mapping[str, Any], path: Path) -> FilmRecord:
    """Return the record in plain data. Raises SceneError with everything that is wrong with it."""
    problems: list[Problem] = []
    record: FilmRecord = schema.read_option(_FILM, data, str(path), problems, schema.FilmTime(None, 1.0))
    raise_problems(problems)
    return record


def parse_film_record(content: bytes, path: Path) -> FilmRecord | None:
    """Return the record in the content of a file; None for what is no record of a film.

    Raises InputError, or SceneError with all problems, where it is one of another version, or is damaged.
    """
    if not may_be_json(content):
        return None
    if len(content) > MAX_SIDECAR_BYTES:
        raise InputError("too large for a sidecar", where=str(path), expected=f"at most {MAX_SIDECAR_BYTES} bytes")
    try:
        data = load_json_object(decode_utf8(content, path), path, kind="a sidecar")
    except InputError:
        if _RECORD_START.match(content):
            raise
        return None  # the YAML parser accepts more, and tells the line
    if not {"scene", "format"} & data.keys():
        return None
    if data.get("format") != FORMAT:
        raise _format_error(data, path)
    return record_from_json(data, path)


_RECORD_START = re.compile(rb'(\xef\xbb\xbf)?\s*\{\s*"(format|scene)"\s*:')


def _format_error(data: Mapping[str, Any], path: Path) -> InputError:
    """Return the error for a record of another version of hsplat, with the keys that have other names now."""
    former = [f"{before}, which is called {now} now" for before, now in _FORMER_KEYS.items() if before in data]
    got = f"format {format_value(data['format'])}" if "format" in data else "; ".join(["no format", *former])
    hint = "render its scene again; it stands under `scene` in this file, and can be saved as a .json file of its own"
    what = "a sidecar of another version of hsplat"
    return InputError(what, where=str(path), got=got, expected=f"format {FORMAT!r}", hint=hint)


def late_frame_problems(record: FilmRecord, num_frames: int) -> list[Problem]:
    """Return the problem of a film whose last frame comes after the end of the path in its scene, if it does."""
    problems: list[Problem] = []
    node = schema.TreeNode(None, f"frames.{len(record.frames) - 1}.frame", problems)
    check_frame_in_path(node, record.numbers[-1], num_frames)
    return problems


def min_max(values: Sequence[float]) -> Range:
    """Return the smallest and the largest value."""
    return min(values), max(values)
