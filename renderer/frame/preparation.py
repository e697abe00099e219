"""Make the stage of each frame, and reuse volumes and layers that have not changed since the frame before."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import repeat
from operator import itemgetter
from typing import Any

import numpy as np

from renderer.errors import InputError
from renderer.frame.stage import FilmStage, Resolution, Stage
from renderer.layers import (
    NO_SOLVED_LIGHT,
    Layer,
    LayerGroup,
    SolvedLight,
    group_layers,
    layer_digest,
    light_of_layers,
    make_layer,
    mask_volume,
)
from renderer.pyramid import EVERY_CUT, FinestCut
from renderer.readers import mix_steps, read_volume
from renderer.scene import (
    CameraSpec,
    ClipSpec,
    FilmScene,
    LayerSpec,
    MaskSpec,
    OverFrames,
    Scene,
    VolumeSpec,
    camera_problems,
    min_tolerance,
    raise_problems,
    steps_in_time,
    volume_extent,
)
from renderer.view import (
    finest_useful_level,
    framed_points,
    make_order_blending,
    place_object_clips,
    smallest_voxel_px,
    visible_centre,
    visible_points,
    volume_corners,
)
from renderer.volume import Float64, Volume, joint_fingerprint, move_volume

Matrix = tuple[tuple[float, ...], ...]
# The plain data that the volume of a layer is made from: its spec, its transform, and its mask.
VolumeKey = tuple[VolumeSpec, Matrix | None, MaskSpec | None]


@dataclass
class StageMaker:
    """A maker of the stages of a film's frames, which keeps the volumes and the layers of the last stage for the next.

    any_tolerance: whether pyramids serve every tolerance, and not only the tolerances of the scene's schedule.
    volumes: the volumes of the last scene's layers, with the keys that they were made from.
    read: the volumes that were read or placed for the last scene, by key.
    layers: the layers of the last scene, by digest. last: the stage of the last scene. light: the light that its layers
        scatter.
    known: the fingerprints that volumes of the film must have.
    """

    num_threads: int
    any_tolerance: bool
    volumes: tuple[Sequence[VolumeKey], Sequence[Volume]] = (), ()
    read: dict[VolumeKey, Volume] = field(default_factory=dict)
    layers: dict[str, Layer] = field(default_factory=dict)
    last: Stage | None = None
    light: SolvedLight = NO_SOLVED_LIGHT
    known: Mapping[VolumeSpec, str] = field(default_factory=dict)

    def stage_at(self, film: FilmStage, frame: int) -> Stage:
        """Return the stage of a frame of a film in which something moves."""
        scene = film.scene.at(frame)
        layers, target = self.layers_of(scene, min_tolerance(film.scene.error)), scene.camera.target
        if not isinstance(target, tuple):
            target = visible_centre(points_in_frame(scene, layers)[0]) if scene.camera.follow else film.target
        stops = None if film.groups[0].light is None else film.groups[0].light.stops
        distance, shift = scene.camera.distance or film.distance, scene.camera.shift or film.shift
        camera = replace(scene.camera, target=target, distance=distance, shift=shift)
        return self.stage_of(scene, layers, camera, stops=stops)

    def volumes_of(self, scene: Scene) -> Sequence[Volume]:
        """Return the volume of each layer of a scene, read once if volumes are equal.

        Raises InputError if a volume cannot be read.
        """
        keys = [volume_key(layer) for layer in scene.layers]
        if keys == self.volumes[0]:
            return self.volumes[1]
        kept: dict[VolumeKey, Volume] = {}

        def keep(key: VolumeKey, make: Callable[[], Volume]) -> Volume:
            if key not in kept:
                kept[key] = self.read[key] if key in self.read else make()
            return kept[key]

        def read(spec: VolumeSpec) -> Volume:
            step = math.floor(spec.time) if isinstance(spec.time, float) else spec.time
            if step == spec.time:
                return self._read(spec)
            assert isinstance(step, int) and isinstance(spec.time, float)
            steps = [replace(spec, time=each) for each in (step, step + 1)]
            before, after = (keep((each, None, None), partial(self._read, each)) for each in steps)
            return mix_steps(before, after, spec.time - step)

        def place(spec: VolumeSpec, matrix: Matrix | None) -> Volume:
            volume = keep((spec, None, None), partial(read, spec))
            return volume if matrix is None else move_volume(volume, np.array(matrix))

        def make(layer: LayerSpec) -> Volume:
            volume, mask = place(layer.volume, layer.transform), layer.mask
            if mask is None:
                return volume
            assert isinstance(mask.volume, VolumeSpec)
            return mask_volume(volume, place(mask.volume, mask.transform), mask.labels.values)

        volumes = [keep(key, partial(make, layer)) for key, layer in zip(keys, scene.layers, strict=True)]
        self.read, self.volumes = kept, (keys, volumes)
        return volumes

    def _read(self, spec: VolumeSpec) -> Volume:
        volume = read_volume(spec)
        if spec in self.known and self.known[spec] != volume.fingerprint:
            what, hint = "this volume was changed while its film is made", "the same command draws all frames again"
            raise InputError(what, where=volume.name, hint=hint)
        return volume

    def layers_of(
        self, scene: Scene, tolerance: float, lap: Callable[[str], object] = lambda _: None
    ) -> tuple[Layer, ...]:
        """Return the layers of a scene. Layers with the same data are made once.

        tolerance: the smallest tolerance of the film. lap: a function that is called with the name of each finished
            step.
        """
        volumes, finest_cut = self.volumes_of(scene), self._finest_cut(scene, tolerance)
        made: dict[str, Layer] = {}
        layers = []
        for spec, volume, digest in zip(scene.layers, volumes, self.digests_of(scene, tolerance), strict=True):
            if digest not in made:
                options: dict[str, Any] = {"finest_cut": finest_cut, "num_threads": self.num_threads, "lap": lap}
                made[digest] = self.layers.get(digest) or make_layer(spec, scene, volume, **options)
            layer = replace(made[digest], spec=spec, shading=scene.shading_of(spec))
            if layer.volume.name != volume.name:  # another file with the same voxels
                layer = replace(layer, volume=replace(layer.volume, name=volume.name))
            layers.append(layer)
        self.layers = made
        return tuple(layers)

    def digests_of(self, scene: Scene, tolerance: float) -> list[str]:
        """Return the digests of the layers of a scene. tolerance: the smallest tolerance of the film."""
        volumes, finest_cut = self.volumes_of(scene), self._finest_cut(scene, tolerance)
        return [layer_digest(*each, finest_cut) for each in zip(scene.layers, repeat(scene), volumes)]

    def _finest_cut(self, scene: Scene, tolerance: float) -> FinestCut:
        if not scene.needs_opengl or self.any_tolerance:
            return EVERY_CUT
        return FinestCut(tolerance, scene.error.finest_level)

    def stage_of(
        self,
        scene: Scene,
        layers: tuple[Layer, ...],
        camera: CameraSpec,
        *,
        stops: float | None = None,
        lap: Callable[[str], object] = lambda _: None,
    ) -> Stage:
        """Return the stage of a scene at a frame. Parts that equal parts of the last stage are taken from it.

        camera: the camera of the scene, with a target, a distance and a shift.
        stops: the exposure of the film's first frame; None if this is the first frame. lap: as in `layers_of`.
        """
        last, target, distance, shift = self.last, camera.target, camera.distance, camera.shift
        assert isinstance(target, tuple) and distance is not None and shift is not None
        for layer in layers:
            raise_problems(camera_problems(camera, scene.output.size, volume_extent(layer.volume)))
        light = light_of_layers(layers, scene, num_threads=self.num_threads, last=self.light, stops=stops)
        has_groups = last is not None and _have_same_groups(last.scene, last.layers, scene, layers)
        has_groups &= light is self.light
        if light is not self.light:
            lap("light")
        self.light = light
        groups = last.groups if last is not None and has_groups else group_layers(layers, scene, light.light)
        has_camera, placed = last is not None and last.camera == camera, layers[0].volume.world_from_index
        if last is not None and has_camera and has_groups:
            resolutions = last.resolutions
        else:
            resolutions = tuple(_resolution(group, camera, scene.output.size) for group in groups)
        if last is not None and has_camera and np.array_equal(placed, last.layers[0].volume.world_from_index):
            order_blending = last.order_blending
        else:
            order_blending = make_order_blending(placed, camera.path, (target, distance))
        self.last = Stage(scene, layers, target, distance, groups, resolutions, order_blending, {}, shift=shift)
        return self.last


@dataclass(frozen=True)
class FilmVolumes:
    """A record of the volumes of a film.

    first: the volumes of the first frame. fingerprint: the joint fingerprint of all volumes of the film. known: the
    fingerprint of each step of a volume that changes over the frames.
    """

    first: Sequence[Volume]
    fingerprint: str
    known: Mapping[VolumeSpec, str]


def read_film_volumes(scene: FilmScene) -> FilmVolumes:
    """Read the volumes of a film, with all steps of each volume that changes in time, one step at a time.

    Raises InputError for files that cannot be read, and for steps that differ in shape or kind.
    """
    maker = StageMaker(1, any_tolerance=False)
    first = [*maker.volumes_of(scene.at(0))]
    volumes = (volume for layer in scene.film_layers for volume in _volumes_of(layer))
    moving = dict.fromkeys(volume for volume in volumes if volume.moves)
    digest, known = hashlib.blake2b(joint_fingerprint(first).encode(), digest_size=16), dict[VolumeSpec, str]()
    for volume in moving:
        digest.update(repr(volume.motions).encode())
        spec = volume.at(0)
        first_step = maker.read[spec, None, None]
        for step in _steps_of(volume):
            like = first_step if step.crop == spec.crop else None
            read = maker.read.get((step, None, None)) or read_volume(step, like=like)
            known[step] = read.fingerprint
            digest.update(known[step].encode())
    return FilmVolumes(first, digest.hexdigest() if moving else joint_fingerprint(first), known)


def _volumes_of(layer: OverFrames[LayerSpec]) -> Sequence[OverFrames[VolumeSpec]]:
    """Return the volume of a layer, and the volume of its mask if it has one."""
    volumes = layer.map(lambda each: tuple(each.volumes.values()))
    return [volumes.map(itemgetter(number)) for number in range(len(volumes.at(0)))]


def _steps_of(volume: OverFrames[VolumeSpec]) -> Sequence[VolumeSpec]:
    """Return the volumes that a film reads for a volume that moves: its steps in time, or the volume at each key."""
    if volume.map(lambda spec: spec.time).moves:
        return steps_in_time(volume)
    return [volume.at(frame) for frame in volume.key_frames]


def volume_key(layer: LayerSpec) -> VolumeKey:
    """Return the plain data that the volume of a layer is made from."""
    return layer.volume, layer.transform, layer.mask


def points_in_frame(scene: Scene, layers: Sequence[Layer]) -> tuple[Float64, float]:
    """Return the positions in the world that must be in frame, float64 [n, 3], and the share of a picture left out.

    Cells that add next to nothing to a picture need not be in frame. The share is how much they add, for the layer
    with the largest share; mostly 0.
    """
    if scene.annotation.bounds:
        return np.concatenate([volume_corners(layer.volume) for layer in layers]), 0.0
    clip = scene.clip if scene.camera.target == "visible" else None
    points, parts = zip(*(_framed_points(layer, clip) for layer in layers), strict=True)
    return np.concatenate(points), max(parts)


def _framed_points(layer: Layer, clip: tuple[ClipSpec, ...] | None) -> tuple[Float64, float]:
    """Return, for one layer, the positions that must be in frame and the share of a picture that is left out.

    clip: clip planes and boxes whose removed parts need not be in frame, besides the layer's own; None to frame the
        whole layer.
    """
    region = None if clip is None else place_object_clips(layer.volume, clip + layer.spec.clip)
    if layer.projection is not None:  # no voxel may be left out, as any may be the brightest on a ray
        return visible_points(layer.pyramid, region), 0.0
    return framed_points(layer.pyramid, region)


def _have_same_groups(before: Scene, layers_before: Sequence[Layer], now: Scene, layers: Sequence[Layer]) -> bool:
    """Return whether two scenes have the same layers, drawn in the same way."""
    are_same = len(layers_before) == len(layers) and all(
        old.pyramid is new.pyramid and old.spec == new.spec for old, new in zip(layers_before, layers, strict=True)
    )
    return are_same and (before.mode, before.blend, before.splat) == (now.mode, now.blend, now.splat)


def _resolution(group: LayerGroup, camera: CameraSpec, size: tuple[int, int]) -> Resolution:
    target, distance = camera.target, camera.distance
    assert isinstance(target, tuple) and distance is not None
    points = np.concatenate([visible_points(layer.pyramid) for layer in group.layers])
    return Resolution(
        finest_useful_level(group.volume, points, camera, target, distance, size),
        smallest_voxel_px(group.volume, camera, target, distance, size),
    )
