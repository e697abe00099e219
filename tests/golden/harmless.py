"""Changes of a picture that are nobody's fault: what a comparison of frames must let pass."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt
from splat_reference import rasterize_reference
from subjects import SUBJECTS, Pixels, Shot

from renderer.draw import GLRasterizer
from renderer.splats import SplatBatch
from renderer.view import View
from tests.support.machines import NothingLasting

# The reference draws one splat after the other: some ten thousand take half a minute.
MOST_SPLATS_OF_REFERENCE = 12_000


@dataclass(frozen=True)
class Harmless:
    """name: what is other. level: the strictest at which it has to pass. make: the picture, or None."""

    name: str
    level: str
    make: Callable[[Shot], Pixels | None]

    def __str__(self) -> str:
        return self.name


@dataclass(frozen=True)
class Machine:
    """Another way to draw the same, in a process of its own. environment: what makes it so."""

    name: str
    level: str
    environment: Mapping[str, str] = field(default_factory=dict)


def _rounded_otherwise(share: float) -> Callable[[Shot], Pixels]:
    """A share of all values, one level up or down."""

    def rounded(shot: Shot) -> Pixels:
        rng = np.random.default_rng(round(1 / share))
        steps = rng.choice([-1, 1], shot.golden.shape) * (rng.random(shot.golden.shape) < share)
        return np.clip(shot.golden + steps, 0, 255).astype(np.uint8)

    return rounded


class _Reference(NothingLasting):
    """Draws as `splat_reference`."""

    def rasterize(self, batch: SplatBatch, order: npt.NDArray[np.uint32], view: View) -> npt.NDArray[np.float32]:
        return rasterize_reference(batch, order, view).astype(np.float32)


def _in_float64(shot: Shot) -> Pixels | None:
    if len(shot.draw_list.orders[0][1]) > MOST_SPLATS_OF_REFERENCE:
        return None
    return shot.drawn(shot.draw_list, _Reference()).image  # type: ignore[arg-type]


HARMLESS = (
    Harmless("drawn again", "exact", lambda shot: shot.drawn(shot.draw_list).image),
    Harmless("0.1 % of values rounded otherwise", "same-machine", _rounded_otherwise(0.001)),
    Harmless("5 % of values rounded otherwise", "cross-driver", _rounded_otherwise(0.05)),
    Harmless("20 % of values rounded otherwise", "cross-driver", _rounded_otherwise(0.2)),
    Harmless("the reference, in float64", "cross-driver", _in_float64),
)

MACHINES = (
    Machine("one thread", "exact", {"LP_NUM_THREADS": "1"}),
    Machine("four threads", "exact", {"LP_NUM_THREADS": "4"}),
    Machine("vectors of 128 bits", "same-machine", {"LP_NATIVE_VECTOR_WIDTH": "128"}),
    Machine("vectors of 256 bits", "same-machine", {"LP_NATIVE_VECTOR_WIDTH": "256"}),
    Machine("vectors of 512 bits", "same-machine", {"LP_NATIVE_VECTOR_WIDTH": "512"}),
    Machine("a processor without AVX", "cross-driver", {"GALLIUM_OVERRIDE_CPU_CAPS": "sse2"}),
    Machine("softpipe", "cross-driver", {"GALLIUM_DRIVER": "softpipe"}),
)


@dataclass(frozen=True)
class Drawn:
    """by: the device and driver, as GL names them. pictures: of the subjects, by name."""

    by: str
    pictures: Mapping[str, Pixels]


def drawn_by(machine: Machine) -> Drawn:
    """All subjects, in a process that has the machine's environment. Raises CalledProcessError where it fails."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "pictures.npz"
        command = [sys.executable, __file__, str(file)]
        subprocess.run(command, check=True, env={**os.environ, "PYTHONPATH": _path(), **machine.environment})
        with np.load(file) as arrays:
            return Drawn(json.loads(str(arrays["by"])), {name: arrays[name] for name in arrays.files if name != "by"})


def _path() -> str:
    """Where this process looks for modules, so that a child finds the same ones."""
    return os.pathsep.join(entry for entry in sys.path if entry)


def _main(file: Path) -> None:
    with GLRasterizer() as rasterizer:
        pictures = {subject.name: Shot(subject, rasterizer).golden for subject in SUBJECTS}
        by = np.array(json.dumps(rasterizer.renderer_name))
    np.savez(file, by=by, **pictures)  # type: ignore[arg-type]


if __name__ == "__main__":
    _main(Path(sys.argv[1]))
