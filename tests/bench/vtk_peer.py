"""Measure VTK's volume mappers on hsplat's scene: the same voxels, transfer function, mode, light, cameras and truth.

VTK draws in a process of its own (`vtk_worker.py`), because two programs cannot share OpenGL in one. Lengths are in
units of the finest spacing, with the origin at the volume's centre, because VTK computes in float32.

VTK's volume ends at the outer voxel centres, hsplat's half a voxel further out. `comparable` hides the difference.

VTK's results include the errors of its look-up tables for the transfer function, of 15 bits of opacity in the
fixed-point mapper, and of 8-bit frames, which alone limit the PSNR to 59 dB on the pixels that a volume covers, where
a pixel has one ray.
"""

from __future__ import annotations

import math
import multiprocessing
import statistics
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field, replace
from itertools import chain
from typing import Any, NamedTuple

import numpy as np
import vtk_worker

from renderer.accuracy import Accuracy, Truth, pool_accuracies
from renderer.errors import InputError
from renderer.scene import Background, ClipSpec, ModeSpec, PlaneSpec, Scene, ShadingSpec
from renderer.transfer import TransferFunction, make_transfer_function
from renderer.view import View
from renderer.volume import Array, Float64, Volume, make_volume

# Steps along the ray, in units of the finest spacing, by mapper and by the rays along a side of a pixel. Left out are
# settings that were slower than others as exact, in frames of engine and bonsai: coarse steps with more rays, in
# projections and light, too, and steps of 0.25 except by the GPU mapper with 4 and 16 rays, which gain up to 7 dB.
_STEPS: dict[str, dict[float, tuple[float, ...]]] = {
    "gpu": {
        1 / 4: (2.0, 4.0),
        1 / 2: (0.5, 1.0, 2.0, 4.0),
        1: (0.5, 1.0, 2.0, 4.0),
        2: (0.25, 0.5, 1.0, 2.0),
        4: (0.25, 0.5, 1.0),
    },
    "fixed point": {
        1 / 4: (0.5, 1.0, 2.0, 4.0),
        1 / 2: (0.5, 1.0, 2.0, 4.0),
        1: (0.5, 1.0, 2.0, 4.0),
        2: (0.5, 1.0, 2.0),
        4: (0.5, 1.0),
    },
}
# Seconds of timed passes after which none begins, as for hsplat.
_REPEAT_LIMIT_S = 4.0

# Both mappers draw these types without conversion.
_NATIVE_DTYPES = ("int8", "uint8", "int16", "uint16", "float32")

# VTK interpolates opacity, hsplat extinction. Between points this close in optical depth the two differ by
# 0.02^2 / 8 = 5e-5.
_DEPTH_BETWEEN_POINTS = 0.02
# Width of the ramp that replaces a step, as a share of the transfer function's range: below the table's resolution.
_STEP_WIDTH = 1e-6

# VTK's name for each mode that it has.
_BLENDS = {
    "emission_absorption": "COMPOSITE_BLEND",
    "maximum": "MAXIMUM_INTENSITY_BLEND",
    "minimum": "MINIMUM_INTENSITY_BLEND",
    "mean": "AVERAGE_INTENSITY_BLEND",
}
# Colours this near to those of a line from black to white are gray: half a step of 8 bits.
_SAME_GRAY = 0.5 / 255

_NOTE = (
    "VTK's frames have 8 bits, and hsplat's are compared before they are rounded to that; the rounding alone limits a "
    "picture of one ray a pixel to about 59 dB where the volume is visible"
)
_LIGHT_NOTE = (
    "highlights of VTK's GPU mapper are Phong's, of a quarter of the shininess, by which narrow ones are the same; its "
    "fixed-point mapper interpolates the light between voxels"
)

# Smallest depth of the near plane, as a share of the far plane's: float32 depths stay distinct.
_NEAREST_PART = 1e-4


class VtkSetting(NamedTuple):
    """A setting of VTK: a mapper, its step along the ray in units of the finest spacing, and its rays.

    rays_across: the rays along a side of a pixel: 2 and 4 for a window of so many times the width and height, whose
    pixels are averaged, and 1/2 and 1/4 for a ray in each square of 2 x 2 or 4 x 4 pixels.
    """

    mapper: str
    sample_distance: float
    rays_across: float = 1

    @property
    def name(self) -> str:
        """Return such as `gpu, step 0.5`, `gpu, 4 rays, step 1` or `fixed point, 1/4 px, step 1`."""
        rays = self.rays_across
        pixels = f", {rays**2:g} rays" if rays > 1 else f", 1/{rays**-2:g} px" if rays < 1 else ""
        return f"{self.mapper}{pixels}, step {self.sample_distance:g}"


class VtkMeasurement(NamedTuple):
    """A setting with the accuracy of each frame, and the seconds of each frame in each timed pass."""

    setting: VtkSetting
    accuracies: tuple[Accuracy, ...]
    seconds: tuple[tuple[float, ...], ...]

    @property
    def overall(self) -> Accuracy:
        """Return the accuracy over all frames together."""
        return pool_accuracies(self.accuracies)

    @property
    def frame_seconds(self) -> float:
        """Return the median time of a frame, over frames and passes."""
        return statistics.median(chain.from_iterable(self.seconds))


def vtk_settings(mode: ModeSpec) -> list[VtkSetting]:
    """Return the settings of all mappers with a mode that may be the fastest for some accuracy."""
    return [
        VtkSetting(mapper, step, across)
        for mapper, steps_by_rays in _STEPS.items()
        if mapper == "gpu" or mode.type != "mean"
        for across, steps in steps_by_rays.items()
        for step in steps
    ]


def check_vtk(scene: Scene) -> None:
    """Raise InputError if VTK cannot draw the scene."""
    for where, is_asked, what in _what_vtk_lacks(scene):
        if is_asked:
            raise InputError(f"VTK cannot be compared: {what}", where=where)


def _what_vtk_lacks(scene: Scene) -> list[tuple[str, object, str]]:
    """Return the keys of what VTK cannot draw, whether the scene asks for it, and why it cannot."""
    (layer, *others), mode = scene.layers, scene.mode
    shading, transfer = layer.shading or ShadingSpec(light="camera"), layer.transfer_function
    is_colored = mode.type == "mean" and _gray_window(make_transfer_function(transfer, 1.0)) is None
    return [
        ("shading.light", shading.light != "camera", "it has a light at the camera alone"),
        (
            "shading.gradient_opacity",
            shading.gradient_opacity,
            "it multiplies opacities by factors, hsplat extinctions",
        ),
        ("shading", shading.has_light_grid, "it has neither this occlusion nor these shadows"),
        ("output.background", len(scene.background or ()) == 2, "it has one colour"),
        ("volumes", others, "it would draw the first alone"),
        ("volume.component", layer.volume.has_colors, "it would draw luminance or alpha alone"),
        ("labels", transfer.labels, "it would interpolate their numbers"),
        ("mask", layer.mask, "it would draw all of the volume"),
        ("clip", scene.clip, "it would draw all of the volume"),
        ("mode", mode.type not in _BLENDS, f"it has no mode {mode.type}"),
        ("mode.color_by", mode.color_by == "depth", "it does not tell where a maximum is"),
        ("transfer_function", is_colored, "its mean is gray, and needs colormap: gray or gray_r"),
    ]


def _gray_window(transfer: TransferFunction) -> tuple[float, float] | None:
    """Return the scalars that are black and white, if colours are linear in between, else None."""
    first, last = transfer.values[0], transfer.values[-1]
    shares = (transfer.values / 2 - first / 2) / (last / 2 - first / 2)
    for black, white, grays in ((first, last, shares), (last, first, 1 - shares)):
        if np.allclose(transfer.colors, grays[:, None], atol=_SAME_GRAY):
            return float(black), float(white)
    return None


def describe_vtk() -> dict[str, str]:
    """Return VTK's `version` and `device`."""
    with _process() as process:
        return process.submit(vtk_worker.describe).result()


def comparable(scene: Scene, volume: Volume) -> tuple[Scene, Volume, list[str]]:
    """Return a scene and a volume that both programs draw alike at the border, and notes on what differs.

    A border would change the length that a mean is taken over, and surround a minimum with an edge that is not there,
    so of these hsplat's volume is clipped where VTK's ends.
    Raises InputError if the volume is too thin, or has voxels without data, or by `with_transparent_border`.
    """
    if volume.num_absent:
        raise InputError(
            "VTK does not draw volumes with voxels without data",
            where=volume.name,
            got=f"{volume.num_absent} of {volume.values.size} voxels",
        )
    if min(volume.shape_xyz) < 3:
        raise InputError(
            "the volume is too thin to be compared with VTK, which draws nothing beyond the outer voxel centres",
            where=volume.name,
            got=" x ".join(map(str, volume.shape_xyz)),
            expected="at least 3 voxels along each axis",
        )
    transfer = look_of(scene, volume).transfer
    if scene.mode.type == "maximum":
        value, _ = volume.value_range()
        red, green, blue = transfer.classify(np.array([value]))[0][0].tolist()
        scene = replace(scene, output=replace(scene.output, background=(red, green, blue)))
        volume = _with_border(volume, value)
        note = f"the outermost layer of voxels was set to {value:g}, and the background to its colour, because"
    elif scene.mode.is_projection:
        scene = replace(scene, clip=_clip_at_voxel_centres(volume))
        note = "the volume was clipped at the centres of the outer voxels, because"
    else:
        volume = with_transparent_border(volume, transfer)
        note = "the outermost layer of voxels was made transparent, because"
    notes = [f"{note} VTK's volumes end half a voxel earlier; the truth, hsplat and VTK all draw this volume", _NOTE]
    return scene, volume, notes + ([_LIGHT_NOTE] if scene.layers[0].shading else [])


def _clip_at_voxel_centres(volume: Volume) -> tuple[ClipSpec, ...]:
    """Return the six planes through the centres of the outer voxels."""
    first = volume.world_from_index[:3, 3]
    last = volume.world_from_index[:3] @ [*(np.array(volume.shape_xyz) - 1.0), 1.0]
    outward = np.linalg.inv(volume.world_from_index[:3, :3] / volume.finest_spacing)
    planes = [(point, sign * row) for point, sign in ((first, -1.0), (last, 1.0)) for row in outward]
    return tuple(ClipSpec(plane=PlaneSpec(tuple(point.tolist()), tuple(row.tolist()))) for point, row in planes)


def with_transparent_border(volume: Volume, transfer: TransferFunction) -> Volume:
    """Return the volume with its outermost layer of voxels set to a transparent value.

    The value is the volume's minimum if that is transparent, else its maximum, else any transparent value.
    Raises InputError if the type has none, or the volume's file was changed.
    """
    value = _transparent_value(volume.values, transfer)
    if value is None:
        raise InputError(
            "the transfer function has no transparent value, which a comparison with VTK needs for the volume's border",
            where=volume.name,
            expected=f"an opacity of 0 at some value of type {volume.values.dtype}",
        )
    return _with_border(volume, value)


def _with_border(volume: Volume, value: Any) -> Volume:
    """Return the volume with its outermost layer of voxels set to a value."""
    values = np.full_like(volume.values, value)
    inner = (slice(1, -1),) * 3
    values[inner] = volume.values[inner]
    volume.require_unchanged()
    return make_volume(values, volume.world_from_index, f"{volume.name} with a border of {value:g}")


def _transparent_value(values: Array, transfer: TransferFunction) -> Any:
    """Return a transparent scalar of the values' type: the lowest, the highest or another one; None without any."""
    limits: Any = np.iinfo(values.dtype) if np.issubdtype(values.dtype, np.integer) else np.finfo(values.dtype)
    points = np.concatenate([transfer.values, transfer.values[1:] / 2 + transfer.values[:-1] / 2])
    near = np.clip([points, np.floor(points), np.ceil(points)], float(limits.min), float(limits.max))
    with np.errstate(invalid="ignore"):  # float64 has no largest int64
        candidates = np.append([values.min(), values.max()], near.astype(values.dtype)).astype(values.dtype)
    hidden = candidates[transfer.classify(candidates)[1] == 0]
    return hidden[0] if hidden.size else None


@dataclass(frozen=True)
class Look:
    """A look that VTK draws a volume with. background: None is black. mode, shading: that `check_vtk` accepts."""

    transfer: TransferFunction
    background: Background
    mode: ModeSpec = field(default_factory=ModeSpec)
    shading: ShadingSpec | None = None


def look_of(scene: Scene, volume: Volume) -> Look:
    """Return what VTK draws the volume of a scene with."""
    transfer = make_transfer_function(scene.layers[0].transfer_function, volume.finest_spacing)
    return Look(transfer, scene.background, scene.mode, scene.layers[0].shading)


def measure_vtk(
    volume: Volume,
    look: Look,
    views: Sequence[View],
    truths: Sequence[Truth],
    *,
    settings: Sequence[VtkSetting],
    repeats: int,
) -> Iterator[VtkMeasurement]:
    """Measure each setting, and yield it at once.

    volume: as in the truths, by `comparable`. views, truths: one for each frame. repeats: the largest number of timed
    passes over the frames, drawing and reading back, after a first one that warms up and gives the pictures, as for
    hsplat.
    """
    voxels, lowest, half_span = _convert_voxels(volume.values)
    points = _points(look.transfer, volume.finest_spacing)
    points[:, 0] = (points[:, 0] / 2 - lowest / 2) / half_span
    if look.mode.is_projection:
        points[:, 4] = 1.0
    finest, world_from_image = volume.finest_spacing, np.eye(4)  # of the image's axes, to the world of the job
    world_from_image[:3, :3] = volume.world_from_index[:3, :3] / volume.spacing
    world_from_image[:3, 3] = (volume.world_from_index[:3, 3] - volume.centre) / finest
    job = {
        "spacing": (volume.spacing / finest).tolist(),
        "world_from_image": world_from_image.tolist(),
        "points": points.tolist(),
        "background": look.background or (0.0, 0.0, 0.0),
        "blend": _BLENDS[look.mode.type],
        "window": _final_window(volume, look),
        "light": look.shading and vars(look.shading),
        "cameras": [_camera(volume, view) for view in views],
    }
    with _process(job, voxels) as process:

        def draw(setting: VtkSetting, camera: int) -> tuple[Array, float]:
            return process.submit(vtk_worker.draw, setting._asdict(), camera).result()

        for setting in settings:
            pictures = (draw(setting, k)[0] / 255.0 for k in range(len(truths)))
            accuracies = tuple(truth.accuracy_of(picture) for truth, picture in zip(truths, pictures, strict=True))
            passes: list[list[float]] = []
            while len(passes) < repeats and sum(map(sum, passes)) < _REPEAT_LIMIT_S:
                passes.append([draw(setting, k)[1] for k in range(len(truths))])
            yield VtkMeasurement(setting, accuracies, tuple(zip(*passes, strict=True)))


def _process(*scene: Any) -> ProcessPoolExecutor:
    """Return VTK's process; a context manager, which ends it. scene: the job and the voxels that it draws, if any."""
    return ProcessPoolExecutor(1, multiprocessing.get_context("spawn"), vtk_worker.begin, scene)


def _final_window(volume: Volume, look: Look) -> tuple[float, float] | None:
    """Return width and middle of VTK's window onto means, as shares of the range of the voxels; None without means."""
    if look.mode.type != "mean":
        return None
    lowest, highest = volume.value_range()
    ends = _gray_window(look.transfer)
    assert ends is not None, "checked with the scene"
    black, white = ((end / 2 - lowest / 2) / (highest / 2 - lowest / 2 or 0.5) for end in ends)
    return white - black, white / 2 + black / 2


def _convert_voxels(values: Array) -> tuple[Array, float, float]:
    """Return voxels that VTK can draw, and (lowest, half span) such that they are `(value - lowest) / span`.

    Other types become float32 in [0, 1], which keeps small differences of large values. The span is halved, because
    that of float64 may overflow.
    """
    if values.dtype.name in _NATIVE_DTYPES:
        return values, 0.0, 0.5
    lowest, highest = float(values.min()), float(values.max())
    half_span = highest / 2 - lowest / 2 or 0.5
    scaled = np.empty(values.shape, np.float32)
    for layer, source in zip(scaled, values, strict=True):  # layer by layer, to save memory
        layer[...] = (source.astype(np.float64) / 2 - lowest / 2) / half_span
    return scaled, lowest, half_span


def _points(transfer: TransferFunction, unit: float) -> Float64:
    """Return float64 [n, 5], value, colour and opacity per `unit` of length, by value; VTK interpolates linearly."""
    values = transfer.values.copy()
    width = _STEP_WIDTH * ((values[-1] - values[0]) or max(abs(values[0]), 1.0))
    is_step = values[:-1] == values[1:]
    values[:-1][is_step] -= width
    depth = transfer.extinctions * unit
    # Position of each new point among the old ones: 0, 0.25, 0.5, 0.75, 1, 2, ...
    counts = np.maximum(np.ceil(np.abs(np.diff(depth)) / _DEPTH_BETWEEN_POINTS), 1).astype(int)
    at = np.concatenate([*(k + np.arange(count) / count for k, count in enumerate(counts)), [len(values) - 1]])
    columns = [np.interp(at, np.arange(len(values)), column) for column in (values, *transfer.colors.T, depth)]
    columns[4] = -np.expm1(-columns[4])
    return np.column_stack(columns)


def _camera(volume: Volume, view: View) -> dict[str, Any]:
    """Convert a View to the size of VTK's window, and the properties of its camera, in the world of the job."""
    finest = volume.finest_spacing
    eye = (view.eye - volume.centre) / finest
    half_extent = np.abs(volume.world_from_index[:3, :3]) @ np.array(volume.shape_xyz) / 2 / finest
    depth, reach = float(-eye @ view.forward), float(np.linalg.norm(half_extent))
    farthest = max(depth + reach, 1.0)
    nearest = max(depth - reach, view.near / finest, farthest * _NEAREST_PART)
    width, height = view.size
    half_height = height / 2 / view.scale_px  # a tangent in perspective, else a length
    camera = {
        "position": eye.tolist(),
        "focal_point": (eye + view.forward).tolist(),
        "view_up": view.axes[1].tolist(),
        "parallel_projection": view.projection == "orthographic",
        "parallel_scale": half_height / finest,
        "view_angle": math.degrees(2 * math.atan(half_height)),
        "clipping_range": (nearest, max(farthest, nearest * 2)),
    }
    return {"size": (width, height), "camera": camera}
