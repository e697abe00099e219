"""Place voxels in the world by affines, check their lengths and directions, and note lengths that are guessed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from renderer.errors import InputError
from renderer.scene import MAX_WORLD_LENGTH, MIN_WORLD_LENGTH, short_text
from renderer.volume import Array, Float64

# The beginning of every note that says that the lengths of voxels are guessed. Such notes are dropped if the scene
# gives a `spacing`.
GUESSED_LENGTHS = "the file does not give its voxel size"
# The note for a file without any lengths.
NO_SPACING = f"{GUESSED_LENGTHS}; 1 x 1 x 1 is assumed"
# The largest number of fields that are named in the note on fields whose lengths have an unknown form.
_MAX_NAMED = 8


def no_spacing(names: Sequence[str]) -> str:
    """Return the note for a file without lengths in a known form.

    names: the fields of the file that may hold lengths in another form, which the note lists.
    """
    listed = ", ".join(short_text(name) for name in names[:_MAX_NAMED])
    return f"{GUESSED_LENGTHS} in a known form; 1 x 1 x 1 is assumed; not applied: {listed}" if names else NO_SPACING


def affine(spacing: npt.ArrayLike, origin: npt.ArrayLike, direction: npt.ArrayLike) -> Float64:
    """Return the affine from voxel indices to the world: `direction @ diag(spacing)`, then the origin, float64 [4, 4].

    direction: [3, 3], whose columns are the directions of the index axes.
    """
    world_from_index = np.eye(4)
    with np.errstate(over="ignore", invalid="ignore"):  # check_axes refuses affines that are not finite
        world_from_index[:3, :3] = np.asarray(direction, np.float64) * np.asarray(spacing, np.float64)
    world_from_index[:3, 3] = origin
    return world_from_index


def in_lps(world_from_index: Float64, factors: tuple[float, ...]) -> Float64:
    """Return an affine with each world axis multiplied by its factor, 1 or -1: for example from RAS to LPS axes.

    The result has no negative zeros.
    """
    return np.asarray(world_from_index * np.array([*factors, 1.0])[:, np.newaxis] + 0.0, np.float64)


def even_steps(coordinates: Array) -> tuple[float, float] | None:
    """Return the first of evenly spaced coordinates and the step between neighbours; None if the step varies or is 0.

    The step of a single coordinate is 1. A coordinate may differ from its even place by a rounding error: a thousandth
    of a step, or the last digits of its float type.
    """
    num_digits = np.finfo(coordinates.dtype).eps if coordinates.dtype.kind == "f" else 0.0
    coordinates = coordinates.astype(np.float64)
    if len(coordinates) == 1:
        return float(coordinates[0]), 1.0
    with np.errstate(over="ignore", invalid="ignore"):
        first, step = float(coordinates[0]), float(coordinates[-1] - coordinates[0]) / (len(coordinates) - 1)
        offsets = np.abs(coordinates - first - step * np.arange(len(coordinates)))
        largest = 1e-3 * abs(step) + 2 * num_digits * np.abs(coordinates).max()
    return (first, step) if step and np.all(offsets <= largest) else None


def has_volume(world_from_index: Float64) -> bool:
    """Return whether an affine is finite and its three index axes are independent, however long they are."""
    if not np.isfinite(world_from_index).all():
        return False
    if not np.abs(world_from_index[:3, :3]).max(axis=0).all():
        return False
    _, axes = _directions(world_from_index)
    return abs(float(np.linalg.det(axes / np.linalg.norm(axes, axis=0)))) > 1e-6


def check_axes(world_from_index: Float64) -> None:
    """Raise InputError unless an affine gives every voxel a place and a volume, however large or small."""
    if not has_volume(world_from_index):
        raise InputError(
            "the spacing, origin and direction give the voxels no volume",
            got=_in_words(world_from_index),
            expected="finite numbers, positive spacings and three independent axes",
            hint="correct them in the file's header, or export it again from its source",
        )


def check_lengths(world_from_index: Float64) -> None:
    """Raise InputError if the spacing or the origin of an affine is outside the range that a scene may have."""
    sizes = np.abs(world_from_index[:3])
    if sizes.max() > MAX_WORLD_LENGTH or sizes[:, :3].max(axis=0).min() < MIN_WORLD_LENGTH:
        raise InputError(
            "the spacing or the origin is out of range",
            got=_in_words(world_from_index),
            expected=f"lengths from {MIN_WORLD_LENGTH:g} to {MAX_WORLD_LENGTH:g}",
            hint="give lengths in another unit",
        )


def _in_words(world_from_index: Float64) -> str:
    rows = ", ".join("[" + " ".join(f"{value:g}" for value in row) + "]" for row in world_from_index[:3])
    return f"{rows} (world from voxel index)"


def spacing_of(world_from_index: Float64) -> tuple[float, float, float]:
    """Return the spacing of an affine: the lengths of its x, y and z index axes, however long or short."""
    largest, unit = _directions(world_from_index)
    x, y, z = (largest * np.linalg.norm(unit, axis=0)).tolist()
    return x, y, z


def with_spacing(world_from_index: Float64, spacing: tuple[float, float, float]) -> Float64:
    """Return an affine whose axes have the lengths `spacing`; directions and origin stay: float64 [4, 4]."""
    _, axes = _directions(world_from_index)
    return affine(spacing, world_from_index[:3, 3], axes / np.linalg.norm(axes, axis=0))


def _directions(world_from_index: Float64) -> tuple[Float64, Float64]:
    """Return the largest component of each index axis, float64 [3], and the axes divided by it, float64 [3, 3].

    The squares of the divided axes neither overflow nor underflow.
    """
    largest = np.abs(world_from_index[:3, :3]).max(axis=0)
    return largest, world_from_index[:3, :3] / largest
