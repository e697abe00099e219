"""A large volume stays in its file: memory is bounded while it is drawn."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from commands import python
from small_scene import small_scene

# Memory that is not a file's (decision 001 in docs/decisions): while bricks are built of a volume; and on the device,
# which is this machine's memory, too, where the renderer is software, with what passes on the way there.
MAX_ATLAS_BYTES, MOST_BYTES_PER_VOXEL = 64 << 20, 1 / 8
BRICK_BYTES = 512 << 20
MOST_BYTES_OF_DEVICE = BRICK_BYTES + (64 << 20)

CHILD = """
import json, sys, threading, time
from pathlib import Path
import numpy as np
from renderer.scene import load_scene
from renderer.frame import prepare_stage, render_frames
from renderer.draw import BrickRasterizer
from renderer.system import MemoryShare
from renderer.volume import make_volume

def anonymous_bytes():
    with open("/proc/self/status") as status:
        (line,) = (line for line in status if line.startswith("RssAnon"))
    return int(line.split()[1]) << 10

class Peak(threading.Thread):
    def __init__(self):
        super().__init__(daemon=True)
        self.most, self.is_over = 0, False
    def run(self):
        while not self.is_over:
            self.most = max(self.most, anonymous_bytes())
            time.sleep(0.002)

scene = load_scene(Path(sys.argv[1]))
with BrickRasterizer(memory=MemoryShare(int(sys.argv[2]))) as rasterizer:
    def draw(stage):
        (frame,) = render_frames(stage, [0], rasterizer, clock=time.perf_counter)
        return frame
    tiny = make_volume(np.arange(64000, dtype=np.uint8).reshape(40, 40, 40) % 200, np.eye(4), "tiny")
    draw(prepare_stage(scene, clock=time.perf_counter, num_threads=2, volumes=[tiny]))  # kernels are there now
    before, peak = anonymous_bytes(), Peak()
    peak.start()
    stage = prepare_stage(scene, clock=time.perf_counter, num_threads=2)
    after_build = peak.most
    frame = draw(stage)
    peak.is_over = True
    peak.join()
    print(json.dumps({
        "build": after_build - before, "all": peak.most - before, "cells": frame.num_cells,
        "mean": float(frame.image.mean()), "is_mapped": stage.layers[0].volume.source is not None,
    }))
"""


@pytest.mark.slow
def test_memory_while_a_large_volume_is_drawn(tmp_path: Path) -> None:
    """Everything in it is visible, so that a pyramid of all levels would take 1.6 bytes a voxel beside the voxels."""
    n = 448
    plane = np.add.outer(np.arange(n), np.arange(n)) % 150 + 60
    with (tmp_path / "large.raw").open("wb") as file:
        for z in range(n):
            file.write(np.roll(plane, z * z // 64, axis=1).astype(np.uint8).tobytes())
    volume = f"raw: {{file: large.raw, shape: [{n}, {n}, {n}], dtype: uint8, spacing: [1, 1, 1]}}"
    error = "tolerance: 0.5, probes: 16"
    scene = small_scene(frames=8, size="96, 96", error=error, footprint="integrated", volume=volume)
    (tmp_path / "large.yaml").write_text(scene)
    found = json.loads(python("-c", CHILD, str(tmp_path / "large.yaml"), str(BRICK_BYTES)).stdout)
    assert found["is_mapped"]
    assert found["cells"] > 50 and found["mean"] > 10  # it is a picture
    most = MAX_ATLAS_BYTES + MOST_BYTES_PER_VOXEL * n**3
    assert found["build"] <= most < n**3
    assert found["all"] <= most + MOST_BYTES_OF_DEVICE
