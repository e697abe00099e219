"""Stages of a volume that is read once, however many ways it is drawn."""

from __future__ import annotations

import time

from hsplat_cli.terminal.cores import num_cores
from renderer.frame.frame import Stage
from renderer.frame.pipeline import prepare
from renderer.scene.spec import Scene
from renderer.volume.volume import Volume


def prepared(scene: Scene, volume: Volume) -> Stage:
    """The scene's stage for a volume that was read before, at any tolerance."""
    return prepare(scene, clock=time.perf_counter, num_threads=num_cores(), volume=volume, any_tolerance=True)
