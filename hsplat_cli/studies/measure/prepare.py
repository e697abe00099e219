"""Prepare the stages of a study, whose volume is read once."""

from __future__ import annotations

import time

from renderer.cores import num_cores
from renderer.frame import Stage, prepare_stage
from renderer.scene import Scene
from renderer.volume import Volume


def stage_at_any_tolerance(scene: Scene, volume: Volume) -> Stage:
    """Return the scene's stage for a volume in memory, at any tolerance."""
    return prepare_stage(scene, clock=time.perf_counter, num_threads=num_cores(), volume=volume, any_tolerance=True)
