"""Draws variants of a scene, each with the lines of YAML that make it."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import replace

from hsplat_cli.preview.studio import Shot, Studio, shot_of
from hsplat_cli.scenes import look_lines
from renderer.errors import HsplatError
from renderer.frame import Stage
from renderer.job import FilmJob, JobEvents, LocalExecutor, forecast_frames
from renderer.scene import Scene, with_tolerance
from renderer.statistics import compute_statistics, hounsfield_zero
from renderer.suggest import VolumeSuggestion, Wish, suggest_read
from renderer.volume import Volume, sampled_volume

# Factors by which variants of a scene multiply its opacity, or that with which a dark picture is bright.
_FACTORS = (0.5, 1.0, 2.0)
# Tolerances at which variants of a scene are drawn.
_TOLERANCES = (1.0, 0.3, 0.1)
# Number of exact rays that measure the accuracy of a scene at each of _TOLERANCES.
_NUM_RAYS = 512
# Values of the option --preset that suit computed tomography.
_CT_PRESETS = ("bone", "vessels", "skin", "xray")
# Values of the option --preset that suit volumes other than computed tomography.
_PRESETS = ("surface", "xray", "glow")
# The largest number of voxels along each axis of a volume from which looks are suggested.
_MOST_LOOKED_AT = 64
# The largest number of voxels along each axis of a volume that is drawn with other looks.
_MOST_DRAWN = 128

# Values of the option --preset, each with the look that it suggests.
Looks = Sequence[tuple[str, VolumeSuggestion]]


def variants(
    studio: Studio, stage: Stage, frame: int, coarser: list[Shot], looks: Looks, denser: float
) -> Iterator[tuple[str, list[Shot]]]:
    """Yield rows of variants of a scene in which nothing moves: a heading, and pictures of a frame.

    frame: the number of the frame in the film. coarser: the pictures by `draw_tolerances`. looks: the looks by
    `suggest_looks`. denser: the factor on the opacity of the variant in the middle, which is 1 unless matter is thin.
    """
    scene = replace(stage.scene, camera=stage.camera)  # framed already: all variants have the same view
    if not scene.mode.is_projection:
        unit = stage.layers[0].transfer.unit
        factors = [denser * factor for factor in _FACTORS]
        yield "Opacity", [_denser(studio, scene, unit / factor, frame, factor) for factor in factors]
    yield "Tolerance, and the cost of the whole film", coarser
    if looks:
        drawn = [sampled_volume(stage.layers[0].volume, _MOST_DRAWN)]
        shots = [_look(studio, scene, frame, word, found, drawn) for word, found in looks]
        yield "Other looks, of some of the voxels", shots


def _denser(studio: Studio, scene: Scene, unit: float, frame: int, factor: float) -> Shot:
    """Draw the scene with all extinctions multiplied by `factor`.

    unit: the length `unit` of the transfer function that has the same effect, for the lines of the scene file.
    """
    caption = f"opacity × {factor:.3g}"
    layers = tuple(replace(layer, weight=factor * layer.weight) for layer in scene.layers)
    if scene.has_list:
        lines = "\n".join(["volumes:", *(f"  - weight: {layer.weight:.6g}" for layer in layers)])
    else:
        ((key, transfer),) = scene.layers[0].look.items()
        lines = f"{key}:\n  unit: {unit:.6g}"
        if scene.needs_opengl:
            layers = scene.with_layers(transfer_function=replace(transfer, unit=unit)).layers
    return studio.shoot(replace(scene, layers=layers), frame, caption, lines)


def draw_tolerances(studio: Studio, job: FilmJob, frame: int, side: int, prepared_s: float) -> list[Shot]:
    """Draw a frame of a film at each of _TOLERANCES, with its measured accuracy and the predicted cost of the film.

    side: the longer side of the pictures, in pixels. prepared_s: the seconds that preparing the film took.
    """
    shots = []
    for tolerance in _TOLERANCES:
        with studio.stage(with_tolerance(job.scene, tolerance)) as stage:
            start, executor = time.perf_counter() - prepared_s, LocalExecutor(studio.rasterizer)
            try:
                found = forecast_frames(stage, executor, job.frames, start, JobEvents(), num_places=1)
                cost = f"the film takes about {found.seconds_text} here, and {found.bytes_text(found.num_bytes)}"
            except HsplatError as error:
                cost = f"the cost of the film is not known: {error.summary}"
            (drawn,) = studio.draw(stage, [frame], _NUM_RAYS)
        assert drawn.record.accuracy is not None, "it was measured"
        low, high = drawn.record.accuracy.interval
        caption = f"tolerance {tolerance:g}: PSNR {low:.1f} to {high:.1f} dB before encoding; {cost}"
        lines = f"error:\n  tolerance: {tolerance:g}"
        shots.append(shot_of(drawn, stage.scene.at(frame).background, caption, lines, side))
    return shots


def suggest_looks(stage: Stage) -> Looks:
    """Suggest looks for a scene of one volume, by the presets that suit its values, from some of its voxels.

    Returns none for a scene of several volumes, labels, colours or splats, with a mask, or with a projection as mode.
    """
    scene, (layer, *others) = stage.scene, stage.layers
    is_plain = not (others or scene.needs_opengl or scene.mode.is_projection or layer.volume.is_labels)
    if not is_plain or layer.spec.volume.has_colors or layer.volume.mask is not None:
        return []
    volume = sampled_volume(layer.volume, _MOST_LOOKED_AT)
    statistics = compute_statistics(volume.values)
    if statistics.minimum == statistics.maximum:
        return []
    words = _PRESETS if hounsfield_zero(statistics) is None else _CT_PRESETS
    return [(word, suggest_read(layer.spec.volume, volume, statistics, Wish(preset=word))) for word in words]


def _look(
    studio: Studio, scene: Scene, frame: int, word: str, found: VolumeSuggestion, drawn: Sequence[Volume]
) -> Shot:
    clip = () if scene.clip else found.suggestion.clip
    shading = found.suggestion.shading if scene.light is None else None
    lines = "\n".join(look_lines(replace(found.suggestion, clip=clip, shading=shading)))
    return studio.shoot(found.applied_to(scene), frame, f"--preset {word}", lines, drawn)
