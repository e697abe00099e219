"""Two frames that belong together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Pixels = npt.NDArray[np.uint8]


@dataclass(frozen=True)
class Pair:
    """name: as in Outcome. golden, actual: uint8 [h, w, 3 or 4], straight alpha; None where one side has no such frame.

    number: of the frame, where its name tells, for the curve over the loop.
    is_golden_missing: that there is no golden, though it is known that there was one.
    """

    name: str
    golden: Pixels | None
    actual: Pixels | None
    number: int | None = None
    is_golden_missing: bool = False
