"""Stages of a volume that is read once, however many ways it is drawn."""

from __future__ import annotations

import time

from renderer.cores import num_cores
from renderer.frame import Stage, prepare_stage
from renderer.scene import Scene
from renderer.volume import Volume


def prepared(scene: Scene, volume: Volume) -> Stage:
    """The scene's stage for a volume that was read before, at any tolerance."""
    return prepare_stage(scene, clock=time.perf_counter, num_threads=num_cores(), volume=volume, any_tolerance=True)
