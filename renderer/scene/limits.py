"""Check that the numbers of a scene fit each other.

`renderer.scene.scene_reading` checks every number by itself. The checks here compare numbers: they refuse a camera so
far away that the volume vanishes, or a pixel that shows less of a voxel than float32 can resolve. `hsplat check` runs
them if the scene gives the volume's size; otherwise `renderer.frame.pipeline.prepare_stage` does, before any work.
Nothing here imports numpy.

The bounds are far outside any sensible value, and well inside what is computed exactly. Drawing is relative to the
volume's centre and to half its diagonal, its *radius*, in float32, with eyes up to MAX_DISTANCE away.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from renderer.errors import Problem, SceneError
from renderer.scene.camera_section import CameraSpec, KeyframePath
from renderer.scene.volume_files import FileSource, UrlSource
from renderer.scene.volume_section import VolumeSpec
from renderer.scene.volume_sources import ArraySource

if TYPE_CHECKING:
    from renderer.volume import Volume

# The largest ratio of a voxel's longest side to its shortest side.
MAX_SPACING_RATIO = 1e5
# The largest distance of a volume's centre from the world's origin, in sides of a voxel: float64 still places voxels to
# 1e-4 of a side.
MAX_OFFSET = 1e12
# The largest distance of the target from the volume's centre, of the eye from the target, and of the near plane from
# the eye, in radii of the volume.
MAX_DISTANCE = 1e12
# The smallest width of a pixel in the world, as a share of a voxel's shortest side.
MIN_PIXEL_VOXELS = 1e-6
# The largest width of a pixel in the world, in radii of the volume.
MAX_PIXEL_RADII = 1e12


@dataclass(frozen=True)
class Extent:
    """A volume's place and size, in world units.

    radius: half of the volume's diagonal, as if its axes were at right angles.
    finest, coarsest: the shortest and the longest side of a voxel.
    """

    centre: tuple[float, ...]
    radius: float
    finest: float
    coarsest: float


def _extent(shape: Sequence[int], spacing: Sequence[float], centre: Sequence[float]) -> Extent:
    """Return the extent of a volume from the numbers and the sides of its voxels along the index axes x, y, z."""
    diagonal = math.hypot(*(num * side for num, side in zip(shape, spacing, strict=True)))
    return Extent(tuple(centre), diagonal / 2, min(spacing), max(spacing))


def volume_extent(volume: Volume) -> Extent:
    """Return the place and the size of a volume."""
    return _extent(volume.shape_xyz, volume.spacing.tolist(), volume.centre.tolist())


def proportion_problems(
    volume: VolumeSpec, camera: CameraSpec, size: tuple[int, int], place: Callable[[str], str]
) -> Iterator[Problem]:
    """Yield the problems of `volume_problems` and `camera_problems` that are known before a volume is read.

    The size of a volume in a file with a header is not known yet: only a spacing in the scene is checked, as for an
    array in memory.
    size: the size of the picture. place: a function that returns the dotted path of a key of the volume.
    """
    source = volume.source
    if isinstance(source, (FileSource, UrlSource, ArraySource)):
        if source.spacing is not None:
            yield from _ratio_problems(max(source.spacing) / min(source.spacing), place("spacing"))
        return
    crop = volume.crop or (None, None, None)
    first_end = tuple(pair or (0, num) for pair, num in zip(crop, source.shape, strict=True))
    shape = tuple(end - first for first, end in first_end)
    centre = tuple(0.5 * (first + end - 1) * side for (first, end), side in zip(first_end, source.spacing, strict=True))
    extent = _extent(shape, source.spacing, centre)
    yield from volume_problems(extent, f"{place(source.key)}.spacing")
    yield from camera_problems(camera, size, extent)


def volume_problems(extent: Extent, path: str) -> Iterator[Problem]:
    """Yield problems for voxels that are too long or too flat, and for a volume too far from the world's origin.

    path: the key of the scene that the problems are reported for.
    """
    yield from _ratio_problems(extent.coarsest / extent.finest, path)
    offset = max(map(abs, extent.centre)) / extent.finest
    if offset > MAX_OFFSET:
        expected = f"at most {MAX_OFFSET:g}: further out, float64 cannot tell its voxels apart"
        what = "the volume is too far from the world's origin for its voxels"
        yield Problem(path, what, f"{offset:.4g} voxels away", expected, "move the volume's origin")


def _ratio_problems(ratio: float, path: str) -> Iterator[Problem]:
    if ratio > MAX_SPACING_RATIO:
        expected = f"a longest side of at most {MAX_SPACING_RATIO:.0e} times the shortest"
        yield Problem(path, "the voxels are too long or too flat", f"sides with a ratio of {ratio:.4g}", expected)


def camera_problems(camera: CameraSpec, size: tuple[int, int], extent: Extent) -> Iterator[Problem]:
    """Yield a problem for each length of the camera, and for a width of pixels, that does not fit the volume's size.

    size: the size of the picture, (width, height).
    """
    away = math.dist(camera.target, extent.centre) if isinstance(camera.target, tuple) else 0.0
    limit = MAX_DISTANCE * extent.radius
    expected = f"at most {limit:.4g}, {MAX_DISTANCE:g} times half the volume's diagonal"
    lengths = (
        ("target", "too far from the volume", away),
        ("distance", "the eye is too far from the target for this volume", camera.distance or 0.0),
        ("near", "too far from the eye for this volume", camera.near),
    )
    too_long = [
        Problem(f"camera.{key}", what, f"{length:.4g}", expected) for key, what, length in lengths if length > limit
    ]
    yield from too_long
    if camera.distance is not None and not too_long:
        yield from _pixel_problems(camera, camera.distance, away, size, extent)


def _pixel_problems(
    camera: CameraSpec, distance: float, away: float, size: tuple[int, int], extent: Extent
) -> Iterator[Problem]:
    """Yield a problem for pixels that are too narrow for the voxels, and one for pixels too wide for the volume.

    away: the distance of the target from the volume's centre.
    """
    # In perspective the far side of the volume is at most this far from any eye of the path.
    depth = distance if camera.projection == "orthographic" else distance + away + extent.radius
    per_unit = 2 * math.tan(math.radians(camera.field_of_view) / 2) / size[1]
    zooms = [key.zoom for key in camera.path.keys] if isinstance(camera.path, KeyframePath) else [1.0]
    smallest, largest = per_unit * depth / max(zooms) / extent.finest, per_unit * depth / min(zooms) / extent.radius
    hint = "see camera.distance, camera.field_of_view and the zoom of keyframes"
    if smallest < MIN_PIXEL_VOXELS:
        expected = f"at least {MIN_PIXEL_VOXELS:g} of a voxel"
        yield Problem(
            "camera", "the picture shows too little of the volume", f"pixels of {smallest:.4g} voxels", expected, hint
        )
    if largest > MAX_PIXEL_RADII:
        got, expected = f"pixels of {largest:.4g} times half its diagonal", f"at most {MAX_PIXEL_RADII:g} times that"
        yield Problem("camera", "the volume is too small in the picture", got, expected, hint)


def raise_problems(problems: Iterable[Problem]) -> None:
    """Raise SceneError if there are problems."""
    if found := list(problems):
        raise SceneError(found)
