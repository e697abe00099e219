"""Stages of a volume that is read once, however many ways it is drawn."""

from __future__ import annotations

import os
import time

from renderer.drawing import Stage
from renderer.pipeline import prepare
from renderer.scene import Scene
from renderer.volume import Volume


def prepared(scene: Scene, volume: Volume) -> Stage:
    """The scene's stage for a volume that was read before, at any tolerance."""
    num_threads = os.cpu_count() or 1
    return prepare(scene, clock=time.perf_counter, num_threads=num_threads, volume=volume, any_tolerance=True)
