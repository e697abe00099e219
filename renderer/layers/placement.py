"""Find the extents of volumes in the world, and refuse volumes that do not fit together on some frame."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from renderer.errors import Problem
from renderer.scene import FilmScene, LayerSpec, OverFrames, format_value, volume_extent, volume_problems
from renderer.volume import Volume, move_volume

Matrix = tuple[tuple[float, ...], ...]

# The largest ratio of the diagonals of two volumes in one scene; a larger one is taken for a mistake in units. A body
# is 300 times as long as a vessel's wall is thick.
_MAX_SIZE_RATIO = 300.0
# The largest ratio of a volume's diagonal to the thickness of its voxels, if the volume is mixed with other volumes:
# rays then take steps of that thickness through all volumes. A volume of 57,000^3 cubic voxels reaches the limit. At a
# ratio of 2.8e5, a picture was as exact as at 2.8e4; at 2.8e6, it lost 10 to 20 dB to samples at float32 positions, and
# took ten times as long.
_MAX_MIXED_DIAGONAL = 1e5


def reach_text(volume: Volume) -> str:
    """Return the extent of a volume in the world, in words."""
    low, high = (format_value([float(f"{at:.6g}") for at in corner]) for corner in volume.world_box)
    return f"from {low} to {high}"


def placement_problems(scene: FilmScene, volumes: Sequence[Volume]) -> Iterator[Problem]:
    """Yield the problems with the positions of volumes, on the first frame with a problem.

    volumes: the volumes of the scene's layers, on its first frame.
    """
    for frame, placed in _placed_by_frame(scene.film_layers, volumes):
        problems = [problem for each in placed for problem in volume_problems(volume_extent(each), each.name)]
        problems += [*_size_problems(placed), *_mixing_problems(scene, placed)]
        if problems:
            when = f"at frame {frame}: " if frame > 0 else ""
            yield from (replace(problem, what=f"{when}{problem.what}") for problem in problems)
            return


def _placed_by_frame(
    layers: Sequence[OverFrames[LayerSpec]], volumes: Sequence[Volume]
) -> Iterator[tuple[int, Sequence[Volume]]]:
    """Yield a frame and the volumes at their positions, for the first frame and each frame on which a volume has moved.

    volumes: the volumes at their positions on the first frame.
    """
    yield 0, volumes
    transforms = [layer.map(lambda each: each.transform) for layer in layers]
    runs = OverFrames(tuple(transforms)).changing_frames
    for first, last in runs:
        for frame in range(first, last + 1):
            yield frame, [_placed(*each, frame) for each in zip(volumes, transforms, strict=True)]


def _placed(volume: Volume, transform: OverFrames[Matrix | None], frame: int) -> Volume:
    """Return a volume at its position on a frame.

    volume: the volume at its position on the first frame. transform: the layer's transform by frame.
    """
    first, now = transform.at(0), transform.at(frame)
    if first is None or now is None or not transform.moves:
        return volume
    return move_volume(volume, np.array(now) @ np.linalg.inv(first))


def _mixing_problems(scene: FilmScene, volumes: Sequence[Volume]) -> Iterator[Problem]:
    """Yield a problem for each volume that is too flat to be mixed with other volumes at every point of a ray."""
    clips = (layer.map(lambda each: each.clip) for layer in scene.film_layers)
    grids = {(each.shape_xyz, each.world_from_index.tobytes(), clip) for each, clip in zip(volumes, clips, strict=True)}
    if len(grids) == 1 or scene.blend == "add" or scene.is_projection or scene.needs_opengl:
        return
    for number, volume in enumerate(volumes):
        thinnest = float(np.linalg.svd(volume.world_from_index[:3, :3], compute_uv=False)[-1])
        diagonal = 2 * volume.half_diagonal
        if diagonal > _MAX_MIXED_DIAGONAL * thinnest:
            what = "this volume is too flat to be mixed with others: rays through it take too many steps"
            got = f"a diagonal of {diagonal:.4g} and voxels {thinnest:.4g} thick, a ratio of {diagonal / thinnest:.4g}"
            hint = "its `transform` and its `spacing` say how thick voxels are; `blend: add` mixes nothing"
            yield Problem(f"volumes.{number}", what, got, f"a ratio of at most {_MAX_MIXED_DIAGONAL:g}", hint)


def _size_problems(volumes: Sequence[Volume]) -> Iterator[Problem]:
    """Yield a problem for each volume far larger or smaller than the first one, as if in another unit of length."""
    for number, volume in enumerate(volumes):
        ratio = volume.half_diagonal / volumes[0].half_diagonal
        if not 1 / _MAX_SIZE_RATIO <= ratio <= _MAX_SIZE_RATIO:
            what = (
                f"this volume is {max(ratio, 1 / ratio):.3g} times as {'large' if ratio > 1 else 'small'} as the first"
            )
            got = f"it reaches {reach_text(volume)}, the first {reach_text(volumes[0])}"
            hint = "are there metres beside millimetres? `spacing` gives the lengths of a voxel"
            yield Problem(f"volumes.{number}", what, got, f"at most {_MAX_SIZE_RATIO:g} times", hint)


def placement_notes(layers: Sequence[LayerSpec], volumes: Sequence[Volume]) -> Iterator[str]:
    """Yield a sentence for each volume that overlaps no other volume; a single volume has no sentence."""
    lows, highs = np.array([volume.world_box for volume in volumes]).swapaxes(0, 1)
    overlaps = ((lows[:, None] < highs) & (lows < highs[:, None])).all(axis=2)
    for layer, volume, num in zip(layers, volumes, overlaps.sum(axis=1).tolist(), strict=True):
        if num == 1 < len(volumes):  # each volume overlaps itself, so 1 means no other
            yield f"{layer.name or volume.name} overlaps no other volume: it reaches {reach_text(volume)}"
