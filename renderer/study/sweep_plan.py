"""What a sweep is going to draw, and about how long that will take."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, replace
from functools import cache

from renderer.frame import Stage, make_primitive
from renderer.scene import ErrorSpec, Scene, SplatSpec, with_tolerance
from renderer.study.tolerances import spread_tolerances

# Tolerances of a series when none are asked for.
_MOST_TOLERANCES = 10
# Seconds, on a software renderer with two cores: only the ratios matter, for the time remaining.
_PER_SPLAT, _PER_TRIANGLE, _PER_SAMPLE, _PER_PICTURE = 1e-6, 1.2e-7, 1e-7, 0.4


@dataclass(frozen=True)
class PlannedSetting:
    """One setting to be measured: the scene at its constant tolerance and with its splats, and how much it draws, as
    in Family."""

    scene: Scene
    work: float

    @property
    def tolerance(self) -> float:
        """The constant one."""
        return self.scene.error.tolerance[0][1]

    def picture_key(self) -> Hashable:
        """Equal for settings whose pictures are equal: single voxels need no correction and have no error."""
        error, splat = self.scene.error, self.scene.splat
        if self.tolerance == 0 and error.finest_level == 0 and splat.footprint != "integrated":
            return replace(splat, opacity_correction=True)
        return error, splat

    def predicted_seconds(self, num_frames: int, repeats: int) -> float:
        """About how long it takes to measure."""
        splat, each = self.scene.splat, _PER_SPLAT
        if splat.footprint == "gouraud":
            each += _PER_TRIANGLE * splat.angular * (2 * splat.radial - 1)
        elif splat.footprint == "integrated":
            each = _PER_SAMPLE
        pass_seconds = num_frames * self.work * each
        passes = 1 + repeats if pass_seconds * repeats < 4.0 else 1
        return num_frames * _PER_PICTURE + passes * pass_seconds


def plan_sweep(
    scene: Scene,
    stage_of: Callable[[Scene], Stage],
    errors: Sequence[ErrorSpec],
    splats: Sequence[SplatSpec],
    tolerances: Sequence[float] | None,
) -> list[PlannedSetting]:
    """Every error measure, with all splats, at all tolerances, from coarse to fine.

    stage_of: prepares a scene; called once for each measure, and for bricks once more.
    tolerances: None for a spread that suits each pyramid, with the scene's own first one, if it has one, among it.
    """
    plan: list[PlannedSetting] = []
    for error in errors:
        splats_by_kind: dict[bool, list[SplatSpec]] = {}
        for splat in splats:
            splats_by_kind.setdefault(splat.footprint == "integrated", []).append(splat)
        for alike in splats_by_kind.values():
            family = replace(scene, error=error, splat=alike[0])
            is_own = (error.measure, error.of) == (scene.error.measure, scene.error.of) and scene.error.goal is None
            works = _work_by_tolerance(stage_of(family), tolerances, scene.error.tolerance[0][1] if is_own else None)
            plan += [
                PlannedSetting(with_tolerance(replace(family, splat=splat), tolerance), work)
                for splat in alike
                for tolerance, work in works.items()
            ]
    return plan


def _work_by_tolerance(stage: Stage, tolerances: Sequence[float] | None, own: float | None) -> dict[float, float]:
    """Tolerances to be measured on a stage, and how much is drawn at each, from coarse to fine.

    own: one that is to be among those that are chosen.
    """
    work = cache(make_primitive(stage).work)
    if tolerances is None:
        tolerances = spread_tolerances(stage.pyramid, work, _MOST_TOLERANCES)
        tolerances += () if own is None else (own,)
    return {tolerance: work(tolerance) for tolerance in sorted(set(tolerances), reverse=True)}
