"""Look at a film before it is drawn, by a few exact rays: does it show nothing, the volume's box, or a picture that is
dark or too bright?

A user then does not spend minutes of drawing on such a film without a warning.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from operator import attrgetter
from pathlib import Path
from typing import NamedTuple, TypeVar

import numpy as np

from renderer.accuracy.darkness import DARK, Darkness, DrawRays, brightness_of, explain_darkness, explain_thinness
from renderer.accuracy.overexposure import overexposed_share, overexposure_note
from renderer.accuracy.truths import is_loop, spread_evenly
from renderer.film import over_background
from renderer.frame import FilmStage, Stage, StageMaker, prepare_stage, view_of
from renderer.layers import Layer
from renderer.scene import FilmScene, LayerSpec
from renderer.statistics import background_value
from renderer.transfer import NO_LIGHT_GRID
from renderer.truth import SceneRays, chord_lengths, pixel_centres
from renderer.view import MOST_LEFT_OUT, View
from renderer.volume import Bools, Float64, Volume, sampled_volume

# At most this many frames of a film are looked at.
_MOST_FRAMES = 3
# The number of rays along the longer side of a frame that is looked at.
_SIDE = 40
# A picture shows next to nothing if its mean difference from its background is less than this, as a share of white.
# Films of vessels, the sparsest of 26 suggestions, have 0.02 and more.
_LEAST_SEEN = 0.005
# A picture shows nothing if its mean difference from its background is less than this share of white: half a step of 8
# bits.
_NOTHING = 0.5 / 255
# A picture shows the box of a volume if at least this share of the rays through the box are more opaque than
# _LEAST_OPACITY. For heads and other objects that touch their box, the share is 0.7 to 0.9.
_MIN_OF_BOX = 0.97
# A ray counts as meeting something visible if its opacity is above this.
_LEAST_OPACITY = 0.03
# A ray through a box counts only if it is longer inside the box than this share of the box's diagonal: rays through the
# edges do not.
_SHORTEST = 0.25
# The largest number of voxels along an axis of the reduced volumes that are looked at if layers of all voxels would
# take too long.
_MOST_SAMPLED = 64
# The step of the rays by which a film is looked at, in voxels.
_STEP_VOXELS = 2.0

T = TypeVar("T")


class Glance(NamedTuple):
    """A fault of the pictures of a film.

    word: the fault in a word or a few, for a table; empty if it is no more than a remark. note: a sentence without its
    full stop. factor: the factor on all extinctions that makes a dark picture of thin matter bright; 1 for no such one.
    """

    word: str
    note: str
    factor: float = 1.0


class _Look(NamedTuple):
    """A look at a frame, by rays through the middles of its pixels.

    seen: the mean difference of the picture from its background, as a share of white. brightness: from 0 to 1.
    """

    frame: int
    view: View
    radiance: Float64
    seen: float
    brightness: float


NOTHING = "nothing"
NOTHING_VISIBLE = (
    "nothing is visible: the transfer function hides every voxel; `hsplat info` shows which values there are"
)
_INFO = "`hsplat info` lists the values that there are"


def look_ahead(stage: FilmStage, frames: Sequence[int], *, num_threads: int) -> list[Glance]:
    """Look at some frames of a film, and return the faults of their pictures, which do not depend on `num_threads`.

    Frames that show next to nothing are a fault only if they are at least half of these frames: films fade in and out.
    """
    numbers = spread_evenly(frames, _MOST_FRAMES, is_loop=is_loop(stage.scene.at(0).camera.path))
    are_boxes, looks, overexposed = list[list[bool]](), list[_Look](), list[float]()
    rays = SceneRays(stage, num_threads=num_threads) if isinstance(stage, Stage) else None
    for number in numbers:
        at = _stage_at(stage, number, num_threads)
        view = _small(view_of(at, number))
        places = pixel_centres(view.size)
        radiance = (rays or SceneRays(at, num_threads=num_threads)).integrate(view, places, _STEP_VOXELS)
        looks.append(_Look(number, view, radiance, _seen(at, view, radiance), brightness_of(at, radiance)))
        overexposed.append(overexposed_share(radiance))
        are_boxes.append([_is_box(layer, view, places, radiance[:, 3]) for layer in at.layers])
    found = list(_empty_glances(stage, looks, num_threads))
    brightest = max(looks, key=attrgetter("brightness"))
    if not found and brightest.brightness < DARK:
        darkness = _explained(explain_darkness, stage, brightest, num_threads)
        amount = f"{100 * brightest.brightness:.2g} % of white"
        found = [Glance("dark", f"most of the picture is dark, at most {amount}: {darkness.why}", darkness.factor)]
    if not found and (note := overexposure_note(at, overexposed)):
        found = [Glance("too bright", note)]
    boxes = np.all(are_boxes, axis=0).tolist()
    if stage.not_framed:
        # A bound, as the share itself is another one on the stage that `look_at_scene` makes from some of the voxels.
        part = f"less than {100 * MOST_LEFT_OUT:.2g} %"
        found.append(Glance("", f"parts that add {part} to a picture are not framed: they may lie outside it"))
    return [
        *found,
        *(each for layer, is_box in zip(stage.layers, boxes, strict=True) if is_box for each in _box_glances(layer)),
    ]


def look_at_scene(scene: FilmScene, frames: Sequence[int], *, num_threads: int) -> list[Glance]:
    """Return the faults of a film as `look_ahead` does, from some of the voxels. Raises the errors of `prepare_stage`.

    Small parts that lie outside of the picture may not be among these voxels: then this fault is not found.
    """
    volumes = StageMaker(num_threads, any_tolerance=True).volumes_of(scene.at(0))
    with _coarse_stage(scene, scene.at(0).layers, volumes, num_threads) as stage:
        return look_ahead(stage, frames, num_threads=num_threads)


def _stage_at(film: FilmStage, number: int, num_threads: int) -> Stage:
    """Return the stage of a frame; if something moves, it is made from some of the voxels to save time."""
    if isinstance(film, Stage):
        return film
    assert film.maker is not None
    scene = film.scene.at(number)
    distance, shift = scene.camera.distance or film.distance, scene.camera.shift or film.shift
    camera = replace(scene.camera, distance=distance, shift=shift)
    camera = camera if camera.follow else replace(camera, target=film.target)
    volumes = film.maker.volumes_of(scene)
    return _coarse_stage(replace(scene, camera=camera), scene.layers, volumes, num_threads).first


def _coarse_stage(
    scene: FilmScene, layers: Sequence[LayerSpec], volumes: Sequence[Volume], num_threads: int
) -> FilmStage:
    """Return a stage whose volumes have only some of the voxels.

    Volumes of labels keep all voxels, because small labels might lose all of theirs.
    """
    some = [
        volume if layer.transfer_function.labels else sampled_volume(volume, _MOST_SAMPLED)
        for layer, volume in zip(layers, volumes, strict=True)
    ]
    return prepare_stage(scene, clock=lambda: 0.0, num_threads=num_threads, volumes=some)


def _small(view: View) -> View:
    """Return the same view in a picture of at most _SIDE pixels along each side."""
    factor = min(1.0, _SIDE / max(view.size))
    width, height = (max(1, round(side * factor)) for side in view.size)
    return replace(view, size=(width, height), scale_px=view.scale_px * height / view.size[1])


def _seen(stage: Stage, view: View, radiance: Float64) -> float:
    """Return the mean difference of a picture from its background, as a share of white."""
    width, height = view.size
    shown, background = radiance.reshape(height, width, 4), stage.scene.background
    differs = np.abs(over_background(shown, background) - over_background(np.zeros_like(shown), background)).max(axis=2)
    return float((np.maximum(differs, shown[..., 3]) if background is None else differs).mean())


def _empty_glances(stage: FilmStage, looks: Sequence[_Look], num_threads: int) -> Iterator[Glance]:
    """Yield the fault of frames that show too little, if they are at least half of the frames that were looked at."""
    empty = [str(look.frame) for look in looks if look.seen < _LEAST_SEEN]
    if 2 * len(empty) < len(looks):
        return
    *others, last = empty
    which = f"frames {', '.join(others)} and {last} show" if others else f"frame {last} shows"
    look = max(looks, key=attrgetter("seen"))
    word, amount, info = "next to nothing", f", {100 * look.seen:.2g} % of white", f"; {_INFO}"
    if look.seen >= _LEAST_SEEN:
        yield Glance(word, f"{which} {word}{info}")
        return
    if look.seen < _NOTHING:
        if not any(layer.pyramid.occupied.any() for layer in stage.layers):
            yield Glance(NOTHING, NOTHING_VISIBLE)
            return
        word, amount, info = NOTHING, "", ""
    explain: Callable[..., Darkness | None] = explain_darkness if look.brightness < DARK else explain_thinness
    found = _explained(explain, stage, look, num_threads)
    why, factor = (info, 1.0) if found is None else (f": {found.why}", found.factor)
    yield Glance(word, f"{which} {word}{amount}{why}", factor)


def _explained(explain: Callable[[Stage, Float64, DrawRays], T], film: FilmStage, look: _Look, num_threads: int) -> T:
    """Return an explanation of a picture, for which its rays may be drawn again, denser or in even light."""
    stage = _stage_at(film, look.frame, num_threads)

    def draw(factor: float = 1.0, *, is_even: bool = False) -> Float64:
        layers = [_changed_layer(layer, factor, is_even=is_even) for layer in stage.layers]
        rays = SceneRays(replace(stage, layers=tuple(layers)), num_threads=num_threads)
        return rays.integrate(look.view, pixel_centres(look.view.size), _STEP_VOXELS)

    return explain(stage, look.radiance, draw)


def _changed_layer(layer: Layer, factor: float, *, is_even: bool) -> Layer:
    """Return a layer, for exact rays, with its extinctions multiplied by a factor, and perhaps in even light."""
    spec = replace(layer.spec, weight=factor * layer.spec.weight)
    if not is_even or spec.shading is None:
        return replace(layer, spec=spec)
    # Factors on extinction by the gradient remain.
    shading = replace(spec.shading, ambient=1.0, diffuse=0.0, specular=0.0, occlusion=0.0, shadow=0.0, silhouette=0.0)
    return replace(layer, spec=replace(spec, shading=shading), light_grid=NO_LIGHT_GRID)


def _is_box(layer: Layer, view: View, places: Float64, opacities: Float64) -> bool:
    """Return whether the picture shows the box of a layer: nearly all rays that meet the box meet something visible."""
    if layer.projection is not None:
        return False
    chords = chord_lengths(layer.volume, view.clipped(layer.spec.clip), places)
    meets: Bools = chords > _SHORTEST * 2 * layer.volume.half_diagonal
    return bool(meets.any() and np.mean(opacities[meets] > _LEAST_OPACITY) >= _MIN_OF_BOX)


def _box_glances(layer: Layer) -> Iterator[Glance]:
    """Yield the fault of a layer whose picture shows its box, if the cause is that its background is visible.

    A volume without background, such as a block that fills its box, has no fault.
    """
    value = background_value(layer.volume)
    if value is not None and float(layer.transfer.classify(np.array([value]))[1][0]) > 0:
        name = Path(layer.volume.name).name
        why = f"its background, near {value:.4g}, is visible"
        yield Glance("its box", f"the picture shows the box of {name}: {why}; `hsplat info` suggests other opacities")
