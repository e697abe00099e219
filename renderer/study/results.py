"""Hold the results of a study: everything that `hsplat measure` found out about a scene."""

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
    """How the truth of one frame was computed.

    seconds: the time that it took. convergence: the changes as the step was halved.
    share_on_volume: the share of pixels that show the volume.
    picture: uint8 [h, w, 3], small.
    """

    frame: int
    seconds: float
    convergence: Convergence
    share_on_volume: float
    picture: npt.NDArray[np.uint8]


@dataclass(frozen=True)
class Study:
    """The results of one study.

    name: of the scene file. scene: with all defaults, from `scene_to_dict`. volume: name, fingerprint, dtype, shape.
    machine: what the numbers depend on: processor, cores, system, driver, commit, versions; and `peer`, with name,
        version and driver, if there is one.
    measurements: in the planned order; those of a peer last.
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
