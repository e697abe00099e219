"""A whole study: everything that `hsplat measure` found out about a scene, for its report."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from renderer.study.sweep import Measurement
from renderer.truth import Convergence


@dataclass(frozen=True)
class TruthRecord:
    """How the truth of one frame came about.

    seconds: what it took. convergence: how the image settled as the step was halved.
    share_on_volume: the part of the pixels in which the volume is seen.
    picture: uint8 [h, w, 3], small.
    """

    frame: int
    seconds: float
    convergence: Convergence
    share_on_volume: float
    picture: npt.NDArray[np.uint8]


@dataclass(frozen=True)
class Study:
    """name: of the scene, as its file is called.
    measurements: in the order in which they were planned; those of a peer last.

    scene: with all defaults, as `scene_to_dict` gives it. volume: name, fingerprint, dtype, shape.
    machine: processor, cores, system, driver, commit, versions: what the numbers depend on; and, where there is a peer,
        `peer`: its name, version and driver.
    notes: what a reader must know: where an error is not monotonic, what was left out, whether it was interrupted.
    """

    name: str
    scene: Mapping[str, Any]
    volume: Mapping[str, Any]
    machine: Mapping[str, Any]
    truth_tolerance: float
    truths: tuple[TruthRecord, ...]
    measurements: tuple[Measurement, ...]
    notes: tuple[str, ...]
