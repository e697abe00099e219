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
class SharedProbes:
    """A record of the errors of a frame at pixels that are probed in the frame beside it, too."""

    first: Annotated[int, types.FRAME, "The first of the two frames."]
    errors: Annotated[
        tuple[float, ...], types.ERRORS, "Of a channel of each, picture minus truth, in levels of 8 bits."
    ]


@dataclass(frozen=True)
class FrameAccuracy:
    """A record of how exact a frame is, by exact rays through some of its pixels."""

    psnr: Annotated[float, types.DECIBELS, "In decibels, of the picture after rounding; 200 where probes see no error."]
    interval: Annotated[
        Range, types.INTERVAL, "In 95 % of cases or more the true value is between these; 200 is no limit."
    ]
    rays: Annotated[int, types.COUNT, "The number of probed pixels, each by several rays."]
    variance: Annotated[float, types.AMOUNT, "The variance of the squared errors, weighted by the chances of pixels."]
    largest: Annotated[float, types.AMOUNT, "The largest magnitude of a weighted squared error, which may be below 0."]
    largest_error: Annotated[float, types.AMOUNT, "The largest error seen of a channel, in [0, 1]; too large at edges."]
    mean: Annotated[float | None, types.COORDINATE, "The mean squared error; left out, it is that of the PSNR."] = None
    shared: Annotated[SharedProbes | None, "The errors that tell flicker, where the frame shares probes."] = None


@dataclass(frozen=True)
class FrameRecord:
    """A record of one frame: its cut and its cost."""

    frame: Annotated[int, types.FRAME, "Its number on the camera's path."]
    tolerance: Annotated[float, types.AMOUNT, "The tolerance of its cut."]
    cells: Annotated[int, types.COUNT, "The cells of the cut, each a brick or a splat."]
    primitives: Annotated[int, types.COUNT, "The cells that the view can show and that are drawn."]
    seconds: Annotated[Amounts, types.AMOUNTS, "The time of each step; `encode` includes writing."]
    rays: Annotated[float | None, types.AMOUNT, "The rays for each pixel, in the mean; left out for splats."] = None
    digest: Annotated[str | None, types.DIGEST, "The digest of its file."] = None
    digests: Annotated[Mapping[str, str] | None, types.DIGESTS, "Digests of its pictures for other outputs."] = None
    predicted_seconds: Annotated[float | None, types.AMOUNT, "The time predicted for it, on a budget of time."] = None
    device: Annotated[str | None, "The device of its worker, on a cluster."] = None
    blank: Annotated[bool, "True where nothing of the volume shows."] = False
    values: Annotated[Mapping[str, Any] | None, types.DATA, "The values that move, by their keys in the scene."] = None
    accuracy: Annotated[FrameAccuracy | None, "The accuracy of its picture, by exact rays."] = None
    visible: Annotated[tuple[float, ...], types.SHARES, "The part of each range of scalars in its mean opacity."] = ()

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
    world_from_index: Annotated[tuple[tuple[float, ...], ...], types.MATRIX, "From voxel indices to the world."]
    unit: Annotated[str, "The unit of lengths in the world."] = ""


@dataclass(frozen=True)
class CameraRecord:
    """A record of where the camera was."""

    target: Annotated[tuple[float, ...], types.VECTOR, "The position in the world that it looks at."]
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

    metric: Annotated[str, "`psnr` or `rmse`."]
    frame: Annotated[int, types.FRAME, "The probe frame with the worst value."]
    probes: Annotated[tuple[Annotated[int, types.FRAME], ...], "All probe frames."]
    worst: Annotated[float | None, types.AMOUNT, "The worst value; left out for the PSNR of equal pictures."] = None


@dataclass(frozen=True)
class ScheduleRecord:
    """A record of the accuracy that was requested and reached."""

    requested: Annotated[ErrorSpec, ERROR_SECTION, "The accuracy, as a section `error` of a scene."]
    tolerance: Annotated[Range, types.RANGE, "The smallest and the largest tolerance of a frame."]
    cells: Annotated[Range, types.RANGE, "The smallest and the largest number of cells of a frame."]
    met: Annotated[bool, "Whether the film reaches the requested accuracy."]
    reproducible: Annotated[bool, "False where the tolerances depend on the speed of the machine."]
    shortfall: Annotated[str | None, "The goal that was missed, and by how much."] = None
    measured: Annotated[MeasuredRecord | None, "The search for an accuracy."] = None
    made_from: Annotated[str | None, "The sidecar that the film was made again from."] = None


@dataclass(frozen=True)
class WorstFrame:
    """A record of the frame that is the least exact by its own rays."""

    frame: Annotated[int, types.FRAME, "Its number."]
    psnr: Annotated[float, types.DECIBELS, "In decibels."]
    interval: Annotated[
        Range, types.INTERVAL, "In 95 % of cases or more the true value is between these; 200 is no limit."
    ]


@dataclass(frozen=True)
class FinerFile:
    """A record of another encoding that keeps more of a film: the compared frames were encoded in both ways."""

    keys: Annotated[Mapping[str, Any], types.DATA, "The keys of the output that differ."]
    psnr: Annotated[float, types.DECIBELS, "In decibels, of the decoded film against the exact pictures."]
    bytes_ratio: Annotated[float, types.AMOUNT, "The bytes of the file by those of the film."]


@dataclass(frozen=True)
class FileAccuracy:
    """A record of the accuracy that is left after encoding."""

    psnr: Annotated[float, types.DECIBELS, "In decibels, of the decoded film against the exact pictures."]
    psnr_of_encoding: Annotated[float, types.DECIBELS, "The same compared with the frames as they were drawn."]
    frames: Annotated[int, types.COUNT, "The number of frames compared, from the first on."]
    finer: Annotated[FinerFile | None, "Another encoding, where the encoder loses more than drawing does."] = None


@dataclass(frozen=True)
class FlickerRecord:
    """A record of how much the errors of all pixels change from one frame to the next."""

    rms: Annotated[float, types.AMOUNT, "The root mean square change of a channel, in levels of 8 bits, 0 to 255."]
    interval: Annotated[Range, types.RANGE, "In 95 % of cases or more the true value is between these."]
    pairs: Annotated[int, types.COUNT, "The number of pairs of neighbouring frames that share probes."]
    probes: Annotated[int, types.COUNT, "The number of probes of all pairs."]


@dataclass(frozen=True)
class FilmAccuracy:
    """A record of how exact the frames of a film are together, by their rays."""

    psnr: Annotated[float, types.DECIBELS, "In decibels, of the mean squared error of all frames."]
    interval: Annotated[
        Range, types.INTERVAL, "In 95 % of cases or more the true value is between these; 200 is no limit."
    ]
    rays: Annotated[int, types.COUNT, "The number of probed pixels in all frames."]
    worst: Annotated[WorstFrame, "The least exact frame."]
    largest_error: Annotated[float, types.AMOUNT, "The largest error seen of a channel, in [0, 1]; too large at edges."]
    method: Annotated[str, "The way in which pixels are chosen."]
    seed: Annotated[int, types.COUNT, "The seed of the choice of pixels."]
    file: Annotated[FileAccuracy | None, "The accuracy of a film in one file; PNG files have the frames'."] = None
    flicker: Annotated[FlickerRecord | None, "The change of errors from frame to frame, of pictures."] = None


@dataclass(frozen=True)
class VisibleRange:
    """A record of the share that a range of scalars has of everything visible."""

    share: Annotated[float, types.AMOUNT, "Its share of the sum of transmittance times opacity."]
    opacity: Annotated[float, types.AMOUNT, "Its largest opacity, per unit of the transfer function."]
    low: Annotated[float | None, types.COORDINATE, "Its smallest scalar; left out where there is none."] = None
    high: Annotated[float | None, types.COORDINATE, "The scalar at which it ends; left out where there is none."] = None
    name: Annotated[str | None, "The labels with these values."] = None
    layer: Annotated[int | None, types.COUNT, "The number of the volume, from 0, if there are several."] = None


@dataclass(frozen=True)
class OutputRecord:
    """A record of a further file of the same drawing."""

    file: Annotated[str, "Its name, or the template of its frames, relative to the sidecar."]
    frames: Annotated[int, types.COUNT, "Its frames."]
    digest: Annotated[str | None, types.DIGEST, "The digest of a film in one file."] = None
    psnr_of_encoding: Annotated[
        float | None, types.DECIBELS, "In decibels, of its first decoded frames against the drawn ones."
    ] = None


@dataclass(frozen=True)
class FilmVisibility:
    """A record of which scalars the pictures of a film show: its visibility histogram, by the rays of its accuracy."""

    coverage: Annotated[float, types.AMOUNT, "The mean opacity of the pictures."]
    ranges: Annotated[
        tuple[VisibleRange, ...],
        "At most 12 ranges between control points of all transfer functions, or 48 of labels.",
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
    predicted_seconds: Annotated[float, types.AMOUNT, "Its predicted time."]
    seconds: Annotated[float, types.AMOUNT, "Its time."]
    after_seconds: Annotated[float, types.AMOUNT, "The time from the start of the job to its end."]
    difference: Annotated[DifferenceRecord | None, "The difference from the pass before."] = None


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

    needed: Annotated[int, types.COUNT, "The bytes of all visible bricks; beyond the limit, bricks are made again."]
    limit: Annotated[int, types.COUNT, "The most bytes that bricks may take."]


@dataclass(frozen=True)
class FilmFingerprint:
    """A fingerprint of a film: all that it depends on, besides the numbers of its frames."""

    frames_digest: Annotated[str, types.DIGEST, "The digest of `depends_on`."]
    encoding: Annotated[Mapping[str, Any], types.DATA, "Formats, frame rate, quality and codec of the files."]
    depends_on: Annotated[Mapping[str, Any], types.DATA, "Scene, voxels, versions and device of the frames."]

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
        "A scene that draws the same frames, with every default.",
    ]
    volume: Annotated[VolumeRecord, "The volume; of several, the first, with the digest of all their fingerprints."]
    camera: Annotated[CameraRecord, "The camera."]
    pyramid: Annotated[PyramidRecord, "The pyramid."]
    device: Annotated[str, "OpenGL's device and driver for splats, the processor for bricks."]
    versions: Annotated[Mapping[str, str], types.TEXTS, "Versions of Python, hsplat and the packages used."]
    schedule: Annotated[ScheduleRecord, "The accuracy."]
    notes: Annotated[tuple[str, ...], "Notes for the user."]
    seconds: Annotated[Amounts, types.AMOUNTS, "The time of each step of the whole film."]
    accuracy: Annotated[FilmAccuracy | None, "The accuracy of all frames together, by exact rays."] = None
    visibility: Annotated[FilmVisibility | None, "The scalars that the pictures show, by the same rays."] = None
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
