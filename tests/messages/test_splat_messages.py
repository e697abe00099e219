"""What is said when splats are not numbers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from splatting import place_splats

from renderer.errors import RenderError


def test_splats_that_are_not_numbers() -> None:
    batch = place_splats([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]], 0.0, 0.0)
    vertices = batch.vertices.copy()
    vertices[1, 2] = np.nan
    with pytest.raises(RenderError) as caught:
        replace(batch, vertices=vertices)
    assert str(caught.value) == (
        "splats that are not numbers\n"
        "  got: 1 of 2 splats, the first is number 1: [1.0, 0.0, nan, 0.0, 0.0, 0.0, 0.0, 0.0]\n"
        "  expected: finite centres and optical areas\n"
        "  hint: this is a fault of hsplat; please report it with the scene file"
    )
