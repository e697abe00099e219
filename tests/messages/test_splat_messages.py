"""What is said when splats are not numbers, and about what is drawn of the octree."""

from __future__ import annotations

from collections.abc import Callable
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
        "splats that are not finite\n"
        "  got: 1 of 2 splats, the first is number 1: [1.0, 0.0, nan, 0.0, 0.0, 0.0, 0.0, 0.0]\n"
        "  expected: finite centres and optical areas\n"
        "  hint: this is a fault of hsplat; please report it with the scene file"
    )


def test_an_unknown_overlay(complaint: Callable[[str, str], str]) -> None:
    assert complaint("output:", "overlay: octtree\noutput:") == (
        """\
scene.yaml:19:10: overlay: unknown value
    | overlay: octtree
    |          ^
  got: 'octtree'
  expected: none or octree
  hint: did you mean octree?"""
    )


def test_a_finest_level_that_no_volume_has(complaint: Callable[[str, str], str]) -> None:
    assert complaint("tolerance: 0.1", "finest_level: 31") == (
        """\
scene.yaml:16:17: error.finest_level: out of range
    | finest_level: 31
    |               ^
  got: 31
  expected: a whole number from 0 to 30"""
    )
