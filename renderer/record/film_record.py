"""Define the record of a film, which its sidecar stores: dataclasses that are written to JSON and read back.

Each field declares its type and a text about it; reading, messages and the site's page of keys are made from these.
Anybody may have edited a sidecar: reading checks everything, and says where a mistake is.
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
    """Parse a recorded scene without checking its values; only the sections that hold paths must be there.

    The scene is checked when it is used.
    """
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

# The lower and the upper end of an interval, or the smallest and the largest of some values.
Range = tuple[float, float]
# Amounts by name, such as the seconds of each step.
Amounts = Mapping[str, float]


# Records of frames


@dataclass(frozen=True)
class SharedProbes:
    """A record of the errors of a frame at the probes that it shares with a neighbouring frame."""

    first: Annotated[int, types.FRAME, "Number of the first of the two frames."]
    errors: Annotated[tuple[float, ...], types.ERRORS, "Picture minus truth at each shared probe, in levels of 8 bits."]


@dataclass(frozen=True)
class FrameAccuracy:
    """A record of how exact a frame is, by exact rays, or paths, through some of its pixels."""

    psnr: Annotated[float, types.DECIBELS, "PSNR of the rounded picture; 200 if probes see no error."]
    interval: Annotated[
        Range, types.INTERVAL, "Bounds of the true PSNR in 95 % of cases or more; 200 means no upper limit."
    ]
    rays: Annotated[int, types.COUNT, "Probed pixels, each with several rays or paths."]
    variance: Annotated[float, types.AMOUNT, "Variance of the weighted squared errors."]
    largest: Annotated[float, types.AMOUNT, "Largest magnitude of a weighted squared error, which may be below 0."]
    largest_error: Annotated[
        float, types.AMOUNT, "Largest error of a probed channel, in [0, 1]; too large at edges, and by paths."
    ]
    mean: Annotated[float | None, types.COORDINATE, "Mean squared error; if left out, the PSNR gives it."] = None
    shared: Annotated[SharedProbes | None, "Errors for flicker, if another frame shares probes."] = None


@dataclass(frozen=True)
class FrameRecord:
    """A record of one frame: its cut, its cost and its accuracy."""

    frame: Annotated[int, types.FRAME, "Number on the camera's path."]
    tolerance: Annotated[float, types.AMOUNT, "Tolerance of the frame's cut."]
    cells: Annotated[int, types.COUNT, "Cells of the cut, each a brick or a splat."]
    primitives: Annotated[int, types.COUNT, "Cells that the view can show."]
    seconds: Annotated[Amounts, types.AMOUNTS, "Seconds of each step; `encode` includes writing."]
    rays: Annotated[float | None, types.AMOUNT, "Mean rays of a pixel; left out for splats."] = None
    digest: Annotated[str | None, types.DIGEST, "Digest of the frame's file."] = None
    digests: Annotated[Mapping[str, str] | None, types.DIGESTS, "Digests of the pictures for other outputs."] = None
    predicted_seconds: Annotated[float | None, types.AMOUNT, "Predicted seconds, on a budget of time."] = None
    device: Annotated[str | None, "Device of the worker, on a cluster."] = None
    blank: Annotated[bool, "True if nothing is visible."] = False
    values: Annotated[Mapping[str, Any] | None, types.DATA, "Values that move, by their keys in the scene."] = None
    accuracy: Annotated[FrameAccuracy | None, "Accuracy of the picture, by exact rays or paths."] = None
    visible: Annotated[
        tuple[float, ...], types.SHARES, "Opacity that each range of scalars adds to the picture's mean opacity."
    ] = ()

    def digest_of(self, kind: PictureKind) -> str | None:
        """Return the digest of the frame's picture of a kind; without one, that of the picture for the first output."""
        return (self.digests or {}).get(kind.name, self.digest)

    @property
    def total_seconds(self) -> float:
        """Return the seconds of all steps, from the start of the frame until it was encoded."""
        return float(sum(self.seconds.values()))


_FRAME = schema.dataclass_field(FrameRecord)
_FRAMES = types.frames(_FRAME, "a list of one or more records of frames")


def read_frame_record(value: object) -> FrameRecord | None:
    """Return the record of a frame from plain data; None if the data are no such record."""
    return types.read_record(_FRAME, value)


# Records of other things, which a film's record has


@dataclass(frozen=True)
class LevelRecord:
    """A record of the level of a store that was chosen, as the scene of the film named none."""

    number: Annotated[int, types.COUNT, "Number of the level; 0 is the finest."]
    num_levels: Annotated[int, types.COUNT, "Levels of the store."]
    why: Annotated[str, "Why the level was chosen."]
    num_bytes: Annotated[int, types.COUNT, "Bytes of its voxels, of one channel and one step in time."]
    num_measured: Annotated[int, types.COUNT, "Bytes of the finest level that were read to measure coarser ones."]
    exact: Annotated[bool, "Whether the level is as exact as the scene asked."]
    asked: Annotated[float | None, types.DECIBELS, "PSNR that the scene asked for; left out at tolerance 0."] = None
    psnr: Annotated[float | None, types.DECIBELS, "PSNR of exact pictures against level 0, if measured."] = None
    least: Annotated[float | None, types.DECIBELS, "PSNR with a margin for the few rays."] = None


@dataclass(frozen=True)
class VolumeRecord:
    """A record of the volume that was drawn."""

    name: Annotated[str, "Name of the volume's file, or of its formula."]
    fingerprint: Annotated[str, types.DIGEST, "Digest of the voxels and of their place in the world."]
    dtype: Annotated[str, "Numeric type of the voxels."]
    shape: Annotated[tuple[int, int, int], types.SHAPE, "Voxels along x, y and z."]
    world_from_index: Annotated[
        tuple[tuple[float, ...], ...], types.MATRIX, "Matrix from indices of voxels to the world."
    ]
    unit: Annotated[str, "Unit of lengths in the world."] = ""
    level: Annotated[LevelRecord | None, "Level of a store, if it was chosen."] = None


@dataclass(frozen=True)
class CameraRecord:
    """A record of the camera's target, its distance, and its place in the picture."""

    target: Annotated[tuple[float, ...], types.VECTOR, "Position in the world that the camera looks at."]
    distance: Annotated[float, types.AMOUNT, "Distance from the eye to the target, in units of the world."]
    shift: Annotated[
        tuple[float, ...] | None,
        types.PAIR,
        "Place of the target right of and above the picture's middle, in shares of its sides.",
    ] = None


@dataclass(frozen=True)
class PyramidRecord:
    """A record of the pyramid of averages and errors."""

    levels: Annotated[int, types.COUNT, "Levels above the voxels."]
    bytes: Annotated[int, types.COUNT, "Memory of the pyramid, in bytes."]
    finest_level_drawn: Annotated[int, types.COUNT, "Level of the smallest cells that could be drawn."]


@dataclass(frozen=True)
class MeasuredRecord:
    """A record of the search for the tolerances that give a wanted accuracy, on some probe frames."""

    metric: Annotated[str, "Metric of the accuracy: `psnr` or `rmse`."]
    frame: Annotated[int, types.FRAME, "Probe frame with the worst value of the metric."]
    probes: Annotated[tuple[Annotated[int, types.FRAME], ...], "Numbers of all probe frames."]
    worst: Annotated[float | None, types.AMOUNT, "Worst value; left out for the PSNR of equal pictures."] = None


@dataclass(frozen=True)
class ScheduleRecord:
    """A record of the accuracy that was requested and reached."""

    requested: Annotated[ErrorSpec, ERROR_SECTION, "Accuracy, as a section `error` of a scene."]
    tolerance: Annotated[Range, types.RANGE, "Tolerances of frames."]
    cells: Annotated[Range, types.RANGE, "Cells of frames."]
    met: Annotated[bool, "Whether the film reaches the requested accuracy."]
    reproducible: Annotated[bool, "False if the tolerances depend on the speed of the machine."]
    shortfall: Annotated[str | None, "Goal that was missed, and by how much."] = None
    measured: Annotated[MeasuredRecord | None, "Search for tolerances that give the accuracy."] = None
    made_from: Annotated[str | None, "Sidecar from which the film was made again."] = None


@dataclass(frozen=True)
class WorstFrame:
    """A record of the least exact frame of a film, by the frame's own rays."""

    frame: Annotated[int, types.FRAME, "Number of the frame."]
    psnr: Annotated[float, types.DECIBELS, "PSNR of the frame."]
    interval: Annotated[
        Range, types.INTERVAL, "Bounds of the true PSNR in 95 % of cases or more; 200 means no upper limit."
    ]


@dataclass(frozen=True)
class FinerFile:
    """A record of another encoding, which keeps more of a film. The compared frames were encoded in both ways."""

    keys: Annotated[Mapping[str, Any], types.DATA, "Keys of the output that differ."]
    psnr: Annotated[float, types.DECIBELS, "PSNR of the decoded film against the exact pictures."]
    bytes_ratio: Annotated[float, types.AMOUNT, "Bytes with this encoding, divided by the bytes of the film."]


@dataclass(frozen=True)
class FileAccuracy:
    """A record of the accuracy of a film after encoding."""

    psnr: Annotated[float, types.DECIBELS, "PSNR of the decoded film against the exact pictures."]
    psnr_of_encoding: Annotated[float, types.DECIBELS, "PSNR of the decoded frames against the drawn ones."]
    frames: Annotated[int, types.COUNT, "Frames compared, from the first on."]
    finer: Annotated[FinerFile | None, "Another encoding, if the encoder loses more than drawing does."] = None
    interval: Annotated[
        Range | None,
        types.INTERVAL,
        "Bounds of the true PSNR of the decoded film in 95 % of cases or more; left out if no rays measured it.",
    ] = None


@dataclass(frozen=True)
class FlickerRecord:
    """A record of flicker: how much the errors of pixels change from one frame to the next."""

    rms: Annotated[float, types.AMOUNT, "Root mean square change of a channel, in levels of 8 bits, 0 to 255."]
    interval: Annotated[Range, types.RANGE, "Bounds of the true change in 95 % of cases or more."]
    pairs: Annotated[int, types.COUNT, "Pairs of neighbouring frames that share probes."]
    probes: Annotated[int, types.COUNT, "Probes of all pairs."]


@dataclass(frozen=True)
class FilmAccuracy:
    """A record of how exact all frames of a film are together, by exact rays or paths."""

    psnr: Annotated[float, types.DECIBELS, "PSNR of all frames, from their mean squared error."]
    interval: Annotated[
        Range, types.INTERVAL, "Bounds of the true PSNR in 95 % of cases or more; 200 means no upper limit."
    ]
    rays: Annotated[int, types.COUNT, "Probed pixels in all frames."]
    worst: Annotated[WorstFrame, "Least exact frame."]
    largest_error: Annotated[
        float, types.AMOUNT, "Largest error of a probed channel, in [0, 1]; too large at edges, and by paths."
    ]
    method: Annotated[str, "Method by which pixels are chosen."]
    seed: Annotated[int, types.COUNT, "Seed of the choice of pixels."]
    file: Annotated[FileAccuracy | None, "Accuracy of a film in one file; left out for PNG files."] = None
    flicker: Annotated[FlickerRecord | None, "Change of the errors of drawn pictures from frame to frame."] = None


@dataclass(frozen=True)
class VisibleRange:
    """A record of a range of scalars, with its share of everything visible."""

    share: Annotated[float, types.AMOUNT, "Range's share of the sum of transmittance times opacity."]
    opacity: Annotated[float, types.AMOUNT, "Largest opacity in the range, per unit of the transfer function."]
    low: Annotated[float | None, types.COORDINATE, "Smallest scalar; left out for a range without one."] = None
    high: Annotated[float | None, types.COORDINATE, "Scalar at which the range ends; left out if none."] = None
    name: Annotated[str | None, "Labels whose values are in the range."] = None
    layer: Annotated[int | None, types.COUNT, "Number of the volume, from 0, if there are several."] = None


@dataclass(frozen=True)
class OutputRecord:
    """A record of a further output file, made from the same drawn frames as the first one."""

    file: Annotated[str, "Name, or template of its frames, relative to the sidecar."]
    frames: Annotated[int, types.COUNT, "Frames in the file."]
    digest: Annotated[str | None, types.DIGEST, "Digest of a film in one file."] = None
    psnr_of_encoding: Annotated[
        float | None, types.DECIBELS, "PSNR of the first decoded frames against the drawn ones."
    ] = None


@dataclass(frozen=True)
class FilmVisibility:
    """A record of the scalars that the pictures of a film show: a visibility histogram, by the rays of its accuracy."""

    coverage: Annotated[float, types.AMOUNT, "Mean opacity of the pictures."]
    ranges: Annotated[
        tuple[VisibleRange, ...],
        "At most 12 ranges between control points of all transfer functions, or 48 of labels.",
    ]


@dataclass(frozen=True)
class DifferenceRecord:
    """A record of how much a pass of a progressive film changed the pictures of the pass before."""

    rmse: Annotated[float, types.AMOUNT, "Root mean square change of a channel, in [0, 1]."]
    frames: Annotated[int, types.COUNT, "Frames compared."]
    psnr_db: Annotated[float | None, types.COORDINATE, "Change as a PSNR, in decibels; left out if 0."] = None


@dataclass(frozen=True)
class PassRecord:
    """A record of one pass of a progressive film."""

    tolerance: Annotated[Range, types.RANGE, "Tolerances of frames."]
    cells: Annotated[Range, types.RANGE, "Cells of frames."]
    predicted_seconds: Annotated[float, types.AMOUNT, "Predicted seconds of the pass."]
    seconds: Annotated[float, types.AMOUNT, "Seconds of the pass."]
    after_seconds: Annotated[float, types.AMOUNT, "Seconds from the start of the job to the end of the pass."]
    difference: Annotated[DifferenceRecord | None, "Difference from the pass before."] = None


@dataclass(frozen=True)
class PartRecord:
    """A record of a part from which a film was assembled."""

    sidecar: Annotated[str, "Sidecar of the part, relative to this one."]
    frames: Annotated[Range, types.RANGE, "First and last frame that was taken."]
    num_frames: Annotated[int, types.COUNT, "Frames that were taken."]
    seconds: Annotated[Amounts, types.AMOUNTS, "Seconds of each step of the part."]
    measured: Annotated[MeasuredRecord | None, "Search for tolerances that give the accuracy."] = None


@dataclass(frozen=True)
class BrickMemoryRecord:
    """A record of the memory that bricks took; pictures do not depend on it."""

    needed: Annotated[int, types.COUNT, "Bytes of all visible bricks; beyond the limit, bricks are made again."]
    limit: Annotated[int, types.COUNT, "Most bytes that bricks may take."]


@dataclass(frozen=True)
class FilmFingerprint:
    """A fingerprint of a film: all inputs that it depends on, besides the numbers of its frames."""

    frames_digest: Annotated[str, types.DIGEST, "Digest of `depends_on`."]
    encoding: Annotated[Mapping[str, Any], types.DATA, "Formats, frame rate, quality and codec of the files."]
    depends_on: Annotated[Mapping[str, Any], types.DATA, "Scene, voxels, versions and device of the frames."]

    @property
    def of_frames(self) -> Fingerprint:
        """Return the fingerprint of the frames, however they are encoded."""
        return Fingerprint(self.frames_digest, self.depends_on)


@dataclass(frozen=True, kw_only=True)
class FilmRecord:
    """A record of how a film was made, at which cost: the content of the sidecar."""

    scene: Annotated[
        Mapping[str, Any],
        _SCENE,
        "A scene that draws the same frames, with every default.",
    ]
    volume: Annotated[VolumeRecord, "Volume; of several volumes the first, with the digest of all fingerprints."]
    camera: Annotated[CameraRecord, "Camera."]
    pyramid: Annotated[PyramidRecord, "Pyramid."]
    device: Annotated[str, "OpenGL's device and driver for splats, the processor for bricks."]
    versions: Annotated[Mapping[str, str], types.TEXTS, "Versions of Python, hsplat and the packages used."]
    schedule: Annotated[ScheduleRecord, "Accuracy that was requested and reached."]
    notes: Annotated[tuple[str, ...], "Notes for the user."]
    seconds: Annotated[Amounts, types.AMOUNTS, "Seconds of each step of the whole film."]
    accuracy: Annotated[FilmAccuracy | None, "Accuracy of all frames together, by exact rays or paths."] = None
    visibility: Annotated[FilmVisibility | None, "Scalars that the pictures show, by the same rays."] = None
    volumes: Annotated[tuple[VolumeRecord, ...], "All volumes, if there are several."] = ()
    exposure: Annotated[
        float | None, types.COORDINATE, "Exposure that `light.exposure: auto` chose, in stops; left out if none."
    ] = None
    memory: Annotated[BrickMemoryRecord | None, "Memory of bricks, if a single process drew."] = None
    passes: Annotated[tuple[PassRecord, ...], "Passes of a progressive film."] = ()
    parts: Annotated[tuple[PartRecord, ...], "Parts of an assembled film."] = ()
    fingerprint: Annotated[
        FilmFingerprint | None, "Fingerprint of the film; left out if a single pass would make another film."
    ] = None
    digest: Annotated[str | None, types.DIGEST, "Digest of a film in one file."] = None
    outputs: Annotated[tuple[OutputRecord, ...], "Further output files, made from the same drawn frames."] = ()
    # The frames, of which there are many, come last in the file.
    frames: Annotated[tuple[FrameRecord, ...], _FRAMES, "Frames, ascending."]

    @property
    def numbers(self) -> tuple[int, ...]:
        """Return the numbers of the frames, ascending."""
        return tuple(record.frame for record in self.frames)


def late_frame_problems(record: FilmRecord, num_frames: int) -> list[Problem]:
    """Return a problem if the last frame of a film comes after the end of the path in its scene.

    num_frames: the number of frames of the path.
    """
    problems: list[Problem] = []
    node = schema.TreeNode(None, f"frames.{len(record.frames) - 1}.frame", problems)
    check_frame_in_path(node, record.numbers[-1], num_frames)
    return problems


def min_max(values: Sequence[float]) -> Range:
    """Return the smallest and the largest value."""
    return min(values), max(values)
