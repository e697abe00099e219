"""Define the data that a film and a frame are drawn from, and the stopwatch of their steps."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Protocol, TypeVar

from renderer.layers import Layer, LayerGroup
from renderer.pyramid import root_error
from renderer.scene import CameraSpec, ClipSpec, FilmScene, Scene, SplatBudget, Vector
from renderer.transfer import linear_of_srgb
from renderer.view import Fog, OrderBlending, View, are_near_faces, make_view, place_object_clips
from renderer.volume import Bools, Float64, Volume

# A function that returns the time now, in seconds since any fixed moment.
Clock = Callable[[], float]
AnyStage = TypeVar("AnyStage", bound="FilmStage")


@dataclass(frozen=True)
class Resolution:
    """A record of the size of a grid's voxels on the pictures of a film.

    finest_level: the level below which cells are too small to see on every frame.
    voxel_px: the finest spacing at the volume's centre, in pixels, on the frame where it is smallest.
    """

    finest_level: int
    voxel_px: float


class FrameStageMaker(Protocol):
    """The interface of an object that makes the stage of each frame of a film."""

    def stage_at(self, film: FilmStage, frame: int) -> Stage: ...

    def volumes_of(self, scene: Scene) -> Sequence[Volume]: ...


@dataclass
class FilmStage:
    """All data that a film is drawn from. The method `at` returns the `Stage` of a frame.

    It owns the layers of the first frame: use it as a context manager, or call `close`. If nothing moves, the stage of
    the film is itself a `Stage`.

    target: the world position that the camera looks at.
    distance: the distance from the eye to the target, in world units.
    groups: the groups of layers that are drawn as one. resolutions: the resolution of each group.
    order_blending: the blending of draw orders along the path.
    seconds: the time that each step of the preparation took. maker: the maker of the stages of frames; None if nothing
        moves.
    not_framed: the share of a picture that is added by cells which need not be in frame; 0 if all must be.
    shift: the place of the target in the picture, as in `CameraSpec`.
    """

    scene: FilmScene
    layers: tuple[Layer, ...]
    target: Vector
    distance: float
    groups: tuple[LayerGroup, ...]
    resolutions: tuple[Resolution, ...]
    order_blending: OrderBlending
    seconds: dict[str, float]
    maker: FrameStageMaker | None = None
    not_framed: float = 0.0
    shift: tuple[float, float] = (0.0, 0.0)

    def at(self, frame: int) -> Stage:
        """Return the stage of a frame, with plain values in its scene. Stages of other frames stay usable."""
        assert self.maker is not None, "of a film in which something moves"
        return self.maker.stage_at(self, frame)

    @property
    def first(self) -> Stage:
        """Return the stage of the first frame, with the layers of this stage."""
        made = self.layers, self.target, self.distance, self.groups, self.resolutions, self.order_blending
        return Stage(self.scene.at(0), *made, self.seconds, shift=self.shift)

    def __enter__(self: AnyStage) -> AnyStage:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Release voxels, pyramids and bricks; nothing can be drawn from the stage any more."""
        self.layers, self.groups, self.maker = (), (), None

    @property
    def largest_error(self) -> float:
        """Return the error of drawing a layer as a single cell, for the layer with the largest error."""
        return max(root_error(layer.pyramid) for layer in self.layers)

    @property
    def chosen_exposure(self) -> float | None:
        """Return the exposure that `light.exposure: auto` chose, in stops; None if nothing was chosen."""
        given, light = self.scene.at(0).light, self.groups[0].light
        return None if given is None or given.exposure is not None or light is None else light.stops

    def require_unchanged(self) -> None:
        """Raise InputError if the file of a volume has changed."""
        for layer in self.layers:
            layer.volume.require_unchanged()


@dataclass
class Stage(FilmStage):
    """All data that one frame is drawn from or, if nothing moves, every frame."""

    scene: Scene

    def at(self, frame: int) -> Stage:
        """Return this stage, whichever frame is asked for; it has the interface of FilmStage.at."""
        return self

    @property
    def first(self) -> Stage:
        """Return this stage, as all its frames have the same stage."""
        return self

    def has_lods_of(self, other: Stage) -> bool:
        """Return whether levels of detail that were made for the stage of another frame fit this stage, too."""
        now, then = self.scene, other.scene
        return (
            self.groups is other.groups
            and self.resolutions == other.resolutions
            and self.order_blending is other.order_blending
            and (now.splat, now.annotation.octree, now.annotation.bounds)
            == (then.splat, then.annotation.octree, then.annotation.bounds)
            and self.lit_clips == other.lit_clips
        )

    @property
    def lit_clips(self) -> list[tuple[ClipSpec, ...]]:
        """Return, for each group of layers, the planes and boxes whose cut faces are lit.

        Only voxels can show this light, so a group has no such planes and boxes if the scene asks for larger cells.
        """
        error = self.scene.error
        has_voxels = error.finest_level == 0 and not isinstance(error.goal, SplatBudget)
        return [
            self.scene.clip + bricks.clip
            if has_voxels and bricks is not None and any(layer.lights_faces for layer in bricks.layers)
            else ()
            for bricks in (group.bricks for group in self.groups)
        ]

    def near_faces(self) -> Iterator[Callable[[Float64], Bools] | None]:
        """Yield a test for each group of layers: which boxes are near a lit cut face; None for a group without one.

        The test takes the bounds of boxes, float64 [n, 2, 3] in index coordinates, and returns bool [n].
        """
        for group, clips in zip(self.groups, self.lit_clips, strict=True):
            region = place_object_clips(group.volume, clips)
            yield None if region is None else partial(are_near_faces, region, group.volume)

    def draws_voxels_only(self, number: int) -> bool:
        """Return whether a group of layers is drawn as voxels at every tolerance, as its light depends on the view.

        Larger cells cannot hold such light. number: the number of the group.
        """
        has_faces_of_view = any(clip.fixed == "camera" for clip in self.lit_clips[number])
        return has_faces_of_view or self.groups[number].draws_voxels_only

    @property
    def camera(self) -> CameraSpec:
        """Return the scene's camera, with the target, distance and shift of this stage in place of those left open."""
        return replace(self.scene.camera, target=self.target, distance=self.distance, shift=self.shift)


class Stopwatch:
    """A stopwatch that adds up seconds between laps, by name. The caller passes the clock."""

    def __init__(self, clock: Clock) -> None:
        self._clock, self._last = clock, clock()
        self.seconds: dict[str, float] = {}

    def lap(self, name: str) -> float:
        """Add the time since the last lap to `name`, and return it."""
        now = self._clock()
        seconds, self._last = now - self._last, now
        self.seconds[name] = self.seconds.get(name, 0.0) + seconds
        return seconds


def view_of(film: FilmStage, frame: int) -> View:
    """Return the view of a frame of the film."""
    stage = film.at(frame)
    view = make_view(stage.camera, frame, stage.target, stage.distance, stage.scene.output.size)
    return replace(view, clip=stage.scene.clip, fog=_fog_of(stage.scene))


def _fog_of(scene: Scene) -> Fog | None:
    """Return the fog of a scene's views, in linear light where the scene has `light`."""
    if scene.fog is None:
        return None
    red, green, blue = scene.fog.color if scene.light is None else linear_of_srgb(scene.fog.color).tolist()
    return Fog((red, green, blue), *scene.fog.range)


def finest_level_at(stage: Stage, tolerance: float, number: int = 0) -> int:
    """Return the finest level of the cells of a group of layers at a tolerance. number: the number of the group."""
    if stage.draws_voxels_only(number):
        return 0
    return max(stage.scene.error.finest_level, stage.resolutions[number].finest_level if tolerance > 0 else 0)
