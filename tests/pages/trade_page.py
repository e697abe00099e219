"""Draw docs/trade.png, a frame of the demo at four tolerances: `python tests/pages/trade_page.py`.

It prints the accuracy of each picture, which docs/precision.md states, and its processor time.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from renderer.accuracy import TRUTH_TOLERANCE, compute_truth
from renderer.draw import open_rasterizer
from renderer.film import encode_png, over_background
from renderer.frame import prepare_stage, render_frames
from renderer.scene import FilmScene, load_scene, with_tolerance
from renderer.volume import UInt8

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "trade.png"
TOLERANCES = (20, 1, 0.3, 0.03)
FRAME = 4
SIZE = (320, 320)
REPEATS = 5


def main() -> None:
    scene = load_scene(ROOT / "configs" / "demo.yaml")
    scene = replace(scene, output=replace(scene.output, size=SIZE))
    PAGE.write_bytes(encode_png(np.concatenate(pictures(scene), axis=1)))
    print(PAGE)


def pictures(scene: FilmScene) -> Sequence[UInt8]:
    """Draw the frame at each tolerance, and print how exact the pictures are and how long they took."""
    found = list[UInt8]()
    with prepare_stage(scene, clock=time.process_time, num_threads=2, any_tolerance=True) as stage:
        truth = compute_truth(stage, FRAME, TRUTH_TOLERANCE)
        for tolerance in TOLERANCES:
            at = replace(stage, scene=with_tolerance(stage.scene, tolerance))
            with open_rasterizer(at.scene) as rasterizer:
                frames = [
                    next(iter(render_frames(at, [FRAME], rasterizer, clock=time.process_time)))
                    for _ in range(REPEATS + 1)
                ]
            psnr = truth.accuracy_of(over_background(frames[0].radiance, scene.background)).everywhere["psnr"]
            seconds = statistics.median(sum(frame.seconds.values()) for frame in frames[1:])
            print(f"tolerance {tolerance:g}: {psnr:.1f} dB, {1000 * seconds:.0f} ms")
            found.append(frames[0].image)
    return found


if __name__ == "__main__":
    main()
