"""Draw variants of a scene, each with the lines that make it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from hsplat_cli.preview.studio import Shot, Studio
from hsplat_cli.scenes import look_lines
from renderer.accuracy import typical_psnr
from renderer.frame import Stage
from renderer.layers import Layer
from renderer.scene import Scene, with_tolerance
from renderer.suggest import Wish, compute_statistics, suggest_read
from renderer.volume import Volume, make_volume

_FACTORS = (0.5, 1.0, 2.0)
_TOLERANCES = (1.0, 0.3, 0.1)
# Words of --preset by a word in the kind of data.
_PRESETS = {
    "CT": ("bone", "vessels", "skin", "xray"),
    "scan": ("surface", "xray", "glow"),
    "field": ("surface", "glow"),
    "density": ("xray", "glow"),
}
# The voxels along each axis from which looks are suggested, and drawn.
_MOST_LOOKED_AT, _MOST_DRAWN = 64, 128


def variants(studio: Studio, stage: Stage, frame: int) -> Iterator[tuple[str, list[Shot]]]:
    """Yield rows of variants of a stage's scene, which is plain: a heading, and pictures of a frame."""
    scene = replace(stage.scene, camera=stage.camera)  # all are seen from one place
    if not scene.mode.is_projection:
        unit = stage.layers[0].transfer.unit
        yield "Opacity", [_denser(studio, scene, unit / factor, frame, factor) for factor in _FACTORS]
    yield "Tolerance", [_coarser(studio, scene, frame, tolerance) for tolerance in _TOLERANCES]
    if looks := [*_looks(studio, scene, stage.layers, frame)]:
        yield "Other looks, of some of the voxels", looks


def _denser(studio: Studio, scene: Scene, unit: float, frame: int, factor: float) -> Shot:
    """Draw the scene with all extinctions times a factor. unit: of a transfer function that does the same."""
    caption = f"opacity × {factor:g}"
    if scene.volumes:
        weights = [f"  - weight: {factor * layer.weight:.6g}" for layer in scene.volumes]
        lines = "\n".join(["volumes:", *weights])
    else:
        section = "transfer_function" if scene.transfer_function.labels is None else "labels"
        lines = f"{section}:\n  unit: {unit:.6g}"
        if scene.needs_opengl:
            denser = replace(scene, transfer_function=replace(scene.transfer_function, unit=unit))
            return studio.shoot(denser, frame, caption, lines)
    layers = tuple(replace(layer, weight=factor * layer.weight) for layer in scene.layers)
    return studio.shoot(replace(scene, volumes=layers), frame, caption, lines)


def _coarser(studio: Studio, scene: Scene, frame: int, tolerance: float) -> Shot:
    psnr = "" if scene.needs_opengl else f", about {typical_psnr(tolerance):.0f} dB"
    lines = f"error:\n  tolerance: {tolerance:g}"
    return studio.shoot(with_tolerance(scene, tolerance), frame, f"tolerance {tolerance:g}{psnr}", lines)


def _looks(studio: Studio, scene: Scene, layers: Sequence[Layer], frame: int) -> Iterator[Shot]:
    """Draw the only volume as presets show it that suit its kind, from some of its voxels."""
    layer, *others = layers
    is_plain = not (others or scene.needs_opengl or scene.mode.is_projection or layer.volume.is_labels)
    if not is_plain or scene.volume.has_colors or layer.volume.mask is not None:
        return
    volume, drawn = _sampled(layer.volume, _MOST_LOOKED_AT), _sampled(layer.volume, _MOST_DRAWN)
    statistics = compute_statistics(volume.values)
    kind = suggest_read(scene.volume, volume, statistics, Wish()).suggestion.kind
    words = next((words for part, words in _PRESETS.items() if part in kind), ())
    for word in words:
        found = suggest_read(scene.volume, volume, statistics, Wish(preset=word))
        clip = () if scene.clip else found.suggestion.clip
        lines = "\n".join(look_lines(replace(found.suggestion, clip=clip)))
        yield studio.shoot(found.applied_to(scene), frame, f"--preset {word}", lines, [drawn])


def _sampled(volume: Volume, most: int) -> Volume:
    """Return every n-th voxel along each axis, of which there are at most `most`."""
    z, y, x = (-(-side // most) for side in volume.values.shape)
    values = np.ascontiguousarray(volume.values[::z, ::y, ::x])
    num_absent = int(np.count_nonzero(np.isnan(values)))
    volume.require_unchanged()
    return make_volume(values, volume.world_from_index @ np.diag([x, y, z, 1.0]), volume.name, num_absent=num_absent)
