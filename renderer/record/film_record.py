"""The record of a film, which its sidecar stores: dataclasses, written to JSON and read back.

Each field declares its type and a sentence about it, from which reading, messages and docs/sidecar.md follow. Anybody
may have edited a sidecar: reading checks everything, and says where a mistake is.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from renderer.errors import Problem
from renderer.record import field_types as types
from renderer.record.up_to_date import Fingerprint
from renderer.scene import ERROR_SECTION, ErrorSpec, PictureKind, check_frame_in_path, schema

_MAPPINGS = schema.sequence_field(schema.MAPPING_FIELD, "a list of mappings")


def _parse_scene(node: schema.TreeNode) -> Any:
    """Parse a recorded scene, which is checked where it is used; paths are taken from these sections anywhere."""
    scene = types.DATA.parse(node)
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


_SCENE: schema.FieldType[Any] = schema.FieldType("a mapping", _parse_scene)

Range = tuple[float, float]
Amounts = Mapping[str, float]


# Frames


@dataclass(frozen=True)
class FrameAccuracy:
    """A record of how exact a frame is, by exact rays through some of its pixels."""

    psnr: Annotated[float, types.DECIBELS, "In decibels, of the picture after rounding; 200 where no ray saw an error."]
    interval: Annotated[Range, types.INTERVAL, "Between these it lies in 95 % of cases, or more."]
    rays: Annotated[int, types.COUNT, "The rays."]
    variance: Annotated[float, types.AMOUNT, "Of the rays' squared errors, each weighted by the chance of its pixel."]
    largest: Annotated[float, types.AMOUNT, "The largest of these."]
    largest_error: Annotated[float, types.AMOUNT, "The largest error seen of a channel, in [0, 1]."]


@dataclass(frozen=True)
class FrameRecord:
    """A record of one frame: its cut and its cost."""

    frame: Annotated[int, types.FRAME, "Its number on the camera's path."]
    tolerance: Annotated[float, types.AMOUNT, "The tolerance of its cut."]
    cells: Annotated[int, types.COUNT, "The cells of the cut, each a brick or a splat."]
    primitives: Annotated[int, types.COUNT, "The cells that the view can show, which are drawn."]
    seconds: Annotated[Amounts, types.AMOUNTS, "The time of each step; `encode` is to write and encode the picture."]
    digest: Annotated[str | None, types.DIGEST, "The digest of its file."] = None
    digests: Annotated[Mapping[str, str] | None, types.DIGESTS, "The digests of its pictures for other outputs."] = None
    predicted_seconds: Annotated[float | None, types.AMOUNT, "The time predicted for it, on a budget of time."] = None
    device: Annotated[str | None, "The device that drew it, on a cluster."] = None
    blank: Annotated[bool, "True where nothing of the volume shows."] = False
    values: Annotated[Mapping[str, Any] | None, types.DATA, "The values that move, by their keys in the scene."] = None
    accuracy: Annotated[FrameAccuracy | None, "How exact its picture is, where rays have measured it."] = None
    visible: Annotated[
        tuple[float, ...], types.SHARES, "The share of each of the film's ranges of scalars in its mean opacity."
    ] = ()

    def digest_of(self, kind: PictureKind) -> str | None:
        """Return the digest of its picture of a kind, or else of its first picture."""
        return (self.digests or {}).get(kind.name, self.digest)

    @property
    def total_seconds(self) -> float:
        """Return the seconds from the start of the frame until the encoder had it."""
        return float(sum(self.seconds.values()))


_FRAME = schema.dataclass_field(FrameRecord)
_FRAMES = types.frames(_FRAME, "a list of one or more records of frames")


def read_frame_record(value: object) -> FrameRecord | None:
    """Return the record of a frame in plain data; None where it is none."""
    return types.read_record(_FRAME, value)


# Parts of a film's record


@dataclass(frozen=True)
class VolumeRecord:
    """A record of the volume that was drawn."""

    name: Annotated[str, "The name of its file, or of its formula."]
    fingerprint: Annotated[str, types.DIGEST, "The digest of its voxels and their place in the world."]
    dtype: Annotated[str, "The type of its voxels."]
    shape: Annotated[tuple[int, int, int], types.SHAPE, "Its voxels along x, y and z."]
    world_from_index: Annotated[tuple[tuple[float, ...], ...], types.MATRIX, "From voxel indices to the world, 4 x 4."]
    unit: Annotated[str, "Of lengths in the world, where it is known."] = ""


@dataclass(frozen=True)
class CameraRecord:
    """A record of where the camera was."""

    target: Annotated[tuple[float, ...], types.VECTOR, "The world position that it looks at."]
    distance: Annotated[float, types.AMOUNT, "From the eye to the target, in world units."]


@dataclass(frozen=True)
class PyramidRecord:
    """A record of the pyramid of averages and errors."""

    levels: Annotated[int, types.COUNT, "Its levels above the voxels."]
    bytes: Annotated[int, types.COUNT, "Its memory."]
    finest_level_drawn: Annotated[int, types.COUNT, "The level of the smallest cells that could be drawn."]


@dataclass(frozen=True)
class MeasuredRecord:
    """A record of the search for the tolerance of an accuracy."""

    metric: Annotated[str, "The metric: `psnr` or `rmse`."]
    frame: Annotated[int, types.FRAME, "The probe frame with the worst value."]
    probes: Annotated[tuple[Annotated[int, types.FRAME], ...], "All probe frames."]
    worst: Annotated[float | None, types.AMOUNT, "The worst value; left out for the PSNR of equal pictures."] = None


@dataclass(frozen=True)
class ScheduleRecord:
    """A record of the accuracy that was requested and reached."""

    requested: Annotated[ErrorSpec, ERROR_SECTION, "The accuracy, as a section `error` of a scene."]
    tolerance: Annotated[Range, types.RANGE, "The smallest and the largest tolerance of a frame."]
    cells: Annotated[Range, types.RANGE, "The smallest and the largest number of cells of a frame."]
    met: Annotated[bool, "Whether the requested accuracy was reached."]
    reproducible: Annotated[bool, "False where the tolerances depend on the speed of the machine."]
    shortfall: Annotated[str | None, "The part of the request that was not reached."] = None
    measured: Annotated[MeasuredRecord | None, "The search for an accuracy."] = None
    made_from: Annotated[str | None, "The sidecar of the film that this one was made again from."] = None


@dataclass(frozen=True)
class WorstFrame:
    """A record of the frame that is the least exact by its own rays."""

    frame: Annotated[int, types.FRAME, "Its number."]
    psnr: Annotated[float, types.DECIBELS, "In decibels."]
    interval: Annotated[Range, types.INTERVAL, "Between these it lies in 95 % of cases, or more."]


@dataclass(frozen=True)
class FileAccuracy:
    """A record of the accuracy that is left after encoding."""

    psnr: Annotated[float, types.DECIBELS, "In decibels, of the film as it is decoded, from the exact pictures."]
    psnr_of_encoding: Annotated[float, types.DECIBELS, "The same from the frames as they were drawn."]
    frames: Annotated[int, types.COUNT, "The frames that were decoded and compared, the first ones."]


@dataclass(frozen=True)
class FilmAccuracy:
    """A record of how exact the frames of a film are together, by their rays."""

    psnr: Annotated[float, types.DECIBELS, "In decibels, of their mean squared error."]
    interval: Annotated[Range, types.INTERVAL, "Between these it lies in 95 % of cases, or more."]
    rays: Annotated[int, types.COUNT, "The rays through all frames."]
    worst: Annotated[WorstFrame, "The least exact frame."]
    largest_error: Annotated[float, types.AMOUNT, "The largest error seen of a channel, in [0, 1]."]
    method: Annotated[str, "How the pixels of the rays were chosen."]
    seed: Annotated[int, types.COUNT, "Of their choice, beside the number of the frame."]
    file: Annotated[
        FileAccuracy | None, "The accuracy after encoding, of a film in one file; PNG files lose nothing."
    ] = None


@dataclass(frozen=True)
class VisibleRange:
    """A record of the share that a range of scalars has of everything visible."""

    share: Annotated[
        float, types.AMOUNT, "The sum of transmittance times opacity; the shares of all ranges add up to 1."
    ]
    opacity: Annotated[float, types.AMOUNT, "Its largest opacity, per unit of the transfer function."]
    low: Annotated[float | None, types.COORDINATE, "Its smallest scalar; left out where there is none."] = None
    high: Annotated[float | None, types.COORDINATE, "The scalar at which it ends; left out where there is none."] = None
    name: Annotated[str | None, "Of labels: which they are; their values lie between the two."] = None
    layer: Annotated[int | None, types.COUNT, "Of several volumes, which one, from 0."] = None


@dataclass(frozen=True)
class OutputRecord:
    """A record of a further file of the same drawing."""

    file: Annotated[str, "Its name, or the template of its frames, relative to the sidecar."]
    frames: Annotated[int, types.COUNT, "Its frames."]
    digest: Annotated[str | None, types.DIGEST, "The digest of a film in one file."] = None
    psnr_of_encoding: Annotated[
        float | None,
        types.DECIBELS,
        "In decibels, of its first frames after decoding, compared with the drawn ones.",
    ] = None


@dataclass(frozen=True)
class FilmVisibility:
    """A record of which scalars the pictures of a film show: its visibility histogram, by the rays of its accuracy."""

    coverage: Annotated[float, types.AMOUNT, "The mean opacity of the pictures."]
    ranges: Annotated[
        tuple[VisibleRange, ...],
        "Between control points of the transfer function, at most 12, or 48 of labels; several volumes share these.",
    ]


@dataclass(frozen=True)
class DifferenceRecord:
    """A record of how much a pass changed."""

    rmse: Annotated[float, types.AMOUNT, "The root mean square change of pixels and channels in [0, 1]."]
    frames: Annotated[int, types.COUNT, "The frames that were compared."]
    psnr_db: Annotated[float | None, types.COORDINATE, "The same in decibels; left out where nothing changed."] = None


@dataclass(frozen=True)
class PassRecord:
    """A record of one pass of a progressive film."""

    tolerance: Annotated[Range, types.RANGE, "The smallest and the largest tolerance of a frame."]
    cells: Annotated[Range, types.RANGE, "The smallest and the largest number of cells of a frame."]
    predicted_seconds: Annotated[float, types.AMOUNT, "The time that was predicted for it."]
    seconds: Annotated[float, types.AMOUNT, "The time that it took."]
    after_seconds: Annotated[float, types.AMOUNT, "When it was finished, from the start of the job."]
    difference: Annotated[DifferenceRecord | None, "From the pass before."] = None


@dataclass(frozen=True)
class PartRecord:
    """A record of a part that a film was assembled from."""

    sidecar: Annotated[str, "The sidecar of the part, relative to this one."]
    frames: Annotated[Range, types.RANGE, "The first and the last frame that was taken."]
    num_frames: Annotated[int, types.COUNT, "The number of frames that were taken."]
    seconds: Annotated[Amounts, types.AMOUNTS, "The time of each step of the part."]
    measured: Annotated[MeasuredRecord | None, "The search for an accuracy."] = None


@dataclass(frozen=True)
class BrickMemoryRecord:
    """A record of the memory of bricks, on which no byte of a picture depends."""

    needed: Annotated[
        int, types.COUNT, "Bytes of all visible bricks: where they exceed the limit, some are made again."
    ]
    limit: Annotated[int, types.COUNT, "The most bytes that bricks could take, by `--memory` or by the free memory."]


@dataclass(frozen=True)
class FilmFingerprint:
    """A fingerprint of a film: all that it depends on, besides the numbers of its frames."""

    frames_digest: Annotated[str, types.DIGEST, "The digest of `depends_on`."]
    encoding: Annotated[Mapping[str, Any], types.DATA, "How the frames were encoded."]
    depends_on: Annotated[
        Mapping[str, Any], types.DATA, "Scene, voxels, versions and device that the frames depend on."
    ]

    @property
    def of_frames(self) -> Fingerprint:
        """Return the fingerprint of the frames, however they are encoded."""
        return Fingerprint(self.frames_digest, self.depends_on)


@dataclass(frozen=True, kw_only=True)
class FilmRecord:
    """A record of the making of a film, and its cost: the content of the sidecar."""

    scene: Annotated[
        Mapping[str, Any],
        _SCENE,
        "A scene that draws the same frames, with every default; its files are relative to the sidecar.",
    ]
    volume: Annotated[VolumeRecord, "The volume; of several, the first, with the digest of all their fingerprints."]
    camera: Annotated[CameraRecord, "The camera."]
    pyramid: Annotated[PyramidRecord, "The pyramid."]
    device: Annotated[
        str, "The device that drew the frames: OpenGL's with its driver for splats, the processor for bricks."
    ]
    versions: Annotated[
        Mapping[str, str], types.TEXTS, "Versions of Python, hsplat and the packages that bytes depend on."
    ]
    schedule: Annotated[ScheduleRecord, "The accuracy."]
    notes: Annotated[tuple[str, ...], "Notes for the user."]
    seconds: Annotated[Amounts, types.AMOUNTS, "The time of each step of the whole film."]
    accuracy: Annotated[FilmAccuracy | None, "How exact the frames are, where rays have measured all of them."] = None
    visibility: Annotated[FilmVisibility | None, "Which scalars the pictures show, where rays have told."] = None
    volumes: Annotated[tuple[VolumeRecord, ...], "Each volume, of several."] = ()
    memory: Annotated[BrickMemoryRecord | None, "The memory of bricks, where one process drew."] = None
    passes: Annotated[tuple[PassRecord, ...], "Passes of a progressive film."] = ()
    parts: Annotated[tuple[PartRecord, ...], "Parts of an assembled film."] = ()
    fingerprint: Annotated[FilmFingerprint | None, "Left out where one pass would not have made this film."] = None
    digest: Annotated[str | None, types.DIGEST, "The digest of a film in one file."] = None
    outputs: Annotated[tuple[OutputRecord, ...], "Further files of the same drawing."] = ()
    # The frames, of which there are many, come last in the file.
    frames: Annotated[tuple[FrameRecord, ...], _FRAMES, "The frames, ascending."]

    @property
    def numbers(self) -> tuple[int, ...]:
        """Return the numbers of the frames, ascending."""
        return tuple(record.frame for record in self.frames)


def late_frame_problems(record: FilmRecord, num_frames: int) -> list[Problem]:
    """Return the problem of a film whose last frame comes after the end of the path in its scene, if it does."""
    problems: list[Problem] = []
    node = schema.TreeNode(None, f"frames.{len(record.frames) - 1}.frame", problems)
    check_frame_in_path(node, record.numbers[-1], num_frames)
    return problems


def min_max(values: Sequence[float]) -> Range:
    """Return the smallest and the largest value."""
    return min(values), max(values)
