"""Changes of a picture that a comparison of frames must accept."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from brick_reference import rasterize_bricks_reference
from machines import WithoutUploads
from splat_reference import rasterize_reference
from subjects import BRICKS, SPLATS, Change, Pixels, Shot, shifted

from renderer.bricks import BrickBatch
from renderer.draw import BrickRasterizer, SplatRasterizer
from renderer.view import View
from renderer.volume import Float32, UInt32

# The references take half a minute for this many splats, or pixels of bricks.
MAX_REFERENCE_SPLATS, MAX_REFERENCE_PIXELS = 12_000, 128 * 128


@dataclass(frozen=True)
class Machine:
    """Another way to draw the same, in a process of its own.

    limit: the strictest at which its pictures have to pass. environment: of the process.
    """

    name: str
    limit: str
    environment: Mapping[str, str] = field(default_factory=dict)


def _rounded_otherwise(shot: Shot, share: float) -> Pixels:
    """Move a share of all values one step up or down."""
    rng = np.random.default_rng(round(1 / share))
    steps = rng.choice([-1, 1], shot.golden.shape) * (rng.random(shot.golden.shape) < share)
    return np.clip(shot.golden + steps, 0, 255).astype(np.uint8)


class _Reference(WithoutUploads):
    """Draws in float64."""

    def rasterize(self, batches: Sequence[Any], orders: Sequence[UInt32], view: View) -> Float32:
        (batch,), (order,) = batches, orders
        if isinstance(batch, BrickBatch):
            return rasterize_bricks_reference(batch, order, view).astype(np.float32)
        return rasterize_reference(batch, order, view).astype(np.float32)


def _in_float64(shot: Shot) -> Pixels | None:
    """Draw by the reference, which takes its time.

    Frames with a subsampled pixel grid are left out: where neighbours differ by nearly the threshold, float64 may draw
    pixels that float32 interpolates. The reference draws no labels.
    """
    if isinstance(shot.batch, BrickBatch):
        is_possible = shot.batch.screen_sampling.strides == (1,) and not shot.stage.layers[0].volume.is_labels
        is_quick = shot.golden.size <= MAX_REFERENCE_PIXELS * shot.golden.shape[2]
    else:
        is_possible, is_quick = True, len(shot.order) <= MAX_REFERENCE_SPLATS
    if not (is_possible and is_quick):
        return None
    return shot.drawn(shot.draw_list, _Reference()).image  # type: ignore[arg-type]


HARMLESS = (
    Change("drawn again", lambda shot: shot.drawn(shot.draw_list).image, "same bytes"),
    Change("0.1 % of values rounded otherwise", partial(_rounded_otherwise, share=0.001), "45 dB"),
    Change("5 % of values rounded otherwise", partial(_rounded_otherwise, share=0.05), "45 dB"),
    Change("20 % of values rounded otherwise", partial(_rounded_otherwise, share=0.2), "45 dB"),
    # About what float32 resolves across a picture.
    Change("rays moved by 0.0001 px", partial(shifted, pixels=1e-4), "45 dB"),
    Change("the reference, in float64", _in_float64, "45 dB"),
)

SPLAT_MACHINES = (
    Machine("one thread", "same bytes", {"LP_NUM_THREADS": "1"}),
    Machine("four threads", "same bytes", {"LP_NUM_THREADS": "4"}),
    Machine("vectors of 128 bits", "40 dB", {"LP_NATIVE_VECTOR_WIDTH": "128"}),
    Machine("vectors of 256 bits", "40 dB", {"LP_NATIVE_VECTOR_WIDTH": "256"}),
    Machine("vectors of 512 bits", "40 dB", {"LP_NATIVE_VECTOR_WIDTH": "512"}),
    Machine("a processor without AVX", "40 dB", {"GALLIUM_OVERRIDE_CPU_CAPS": "sse2"}),
    Machine("softpipe", "40 dB", {"GALLIUM_DRIVER": "softpipe"}),
)

BRICK_MACHINES = (
    Machine("one thread", "same bytes", {"NUM_THREADS": "1"}),
    Machine("four threads", "same bytes", {"NUM_THREADS": "4"}),
    Machine("a processor without AVX", "same bytes", {"HSPLAT_PROCESSOR_LEVEL": "1"}),
)


def drawn_by(machine: Machine, primitive: str) -> tuple[str, dict[str, Pixels]]:
    """Draw all subjects in a process that has the machine's environment. Raises CalledProcessError where it fails.

    Return the device and driver, as they name themselves, and the pictures by the names of their subjects.
    """
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "pictures.npz"
        command = [sys.executable, __file__, str(file), primitive]
        modules = os.pathsep.join(filter(None, sys.path))  # the child looks for them where this process does
        subprocess.run(command, check=True, env={**os.environ, "PYTHONPATH": modules, **machine.environment})
        with np.load(file) as arrays:
            pictures = dict(arrays)
    return str(pictures.pop("by")), pictures


def _main(file: Path, primitive: str) -> None:
    num_threads = int(os.environ.get("NUM_THREADS", "2"))
    with SplatRasterizer() as of_splats, BrickRasterizer(num_threads=num_threads) as of_bricks:
        subjects = SPLATS if primitive == "splats" else BRICKS
        pictures = {subject.name: Shot(subject, of_splats, of_bricks).golden for subject in subjects}
        by = of_splats.device if primitive == "splats" else of_bricks.device
    np.savez(file, by=by, **pictures)  # type: ignore[arg-type]


if __name__ == "__main__":
    _main(Path(sys.argv[1]), *sys.argv[2:])
