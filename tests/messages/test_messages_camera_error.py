"""Whole messages about the camera and the error, the sections of a scene."""

from __future__ import annotations

from collections.abc import Callable

import pytest

# What is replaced in the scene, by what, and what is said about it.
CASES = {
    "elevation": (
        "elevation: 20",
        "elevation: 91",
        """\
scene.yaml:13:51: camera.path.elevation: out of range
    | path: {type: turntable, frames: 120, elevation: 91}
    |                                                 ^
  got: 91
  expected: a number from -90 to 90
""",
    ),
    "field_of_view": (
        "distance: 300",
        "field_of_view: 180",
        """\
scene.yaml:12:18: camera.field_of_view: out of range
    | field_of_view: 180
    |                ^
  got: 180
  expected: a number from 0.001 to 179.9
""",
    ),
    "axis": (
        "elevation: 20",
        "axis: w",
        """\
scene.yaml:13:46: camera.path.axis: not an axis
    | path: {type: turntable, frames: 120, axis: w}
    |                                            ^
  got: 'w'
  expected: x, y, z, -x, -y, -z or a direction [x, y, z], not all 0
""",
    ),
    "too_short_a_direction": (
        "elevation: 20",
        "axis: [1e-320, 0, 0]",
        """\
scene.yaml:13:46: camera.path.axis: no direction
    | path: {type: turntable, frames: 120, axis: [1e-320, 0, 0]}
    |                                            ^
  got: [1e-320, 0, 0]
  expected: x, y, z, -x, -y, -z or a direction [x, y, z], not all 0
  hint: a component of at least 1e-30
""",
    ),
    "no_direction": (
        "elevation: 20",
        "axis: [0, 0, 0]",
        """\
scene.yaml:13:46: camera.path.axis: no direction
    | path: {type: turntable, frames: 120, axis: [0, 0, 0]}
    |                                            ^
  got: [0, 0, 0]
  expected: x, y, z, -x, -y, -z or a direction [x, y, z], not all 0
""",
    ),
    "eye_at_the_target": (
        "distance: 300",
        "distance: 0",
        """\
scene.yaml:12:13: camera.distance: out of range
    | distance: 0
    |           ^
  got: 0
  expected: a number from 1e-30 to 1e+30
""",
    ),
    "zoom": (
        "{type: turntable, frames: 120, elevation: 20}",
        "{type: keyframes, frames: 9, keys: [{frame: 0, azimuth: 0, elevation: 0, zoom: 1e19}]}",
        """\
scene.yaml:13:88: camera.path.keys.0.zoom: out of range
    | path: {type: keyframes, frames: 9, keys: [{frame: 0, azimuth: 0, elevation: 0, zoom: 1e19}]}
    |                                                                                      ^
  got: 1e+19
  expected: a number from 1e-06 to 1000000
""",
    ),
    "keys_out_of_order": (
        "{type: turntable, frames: 120, elevation: 20}",
        """\

    type: keyframes
    frames: 60
    keys:
      - {frame: 30, azimuth: 0, elevation: 0}
      - {frame: 0, azimuth: 90, elevation: 0}
      - {frame: 60, azimuth: 90, elevation: 0}\
""",
        """\
scene.yaml:18:17: camera.path.keys.1.frame: keys out of order
    | - {frame: 0, azimuth: 90, elevation: 0}
    |           ^
  got: 0
  expected: a frame after 30, that of the key before
scene.yaml:19:17: camera.path.keys.2.frame: after the last frame
    | - {frame: 60, azimuth: 90, elevation: 0}
    |           ^
  got: 60
  expected: a frame from 0 to 59
""",
    ),
    "scalar_and_optical": (
        "measure: optical",
        """\
measure: optical
  of: scalar\
""",
        """\
scene.yaml:16:7: error.of: contradicts measure: optical
    | of: scalar
    |     ^
  got: 'scalar'
  expected: classified
  hint: the error of the scalar needs measure: rms
""",
    ),
    "tolerance_too_small": (
        "tolerance: 0.1",
        "tolerance: 1e-400",
        """\
scene.yaml:16:14: error.tolerance: too small a number to tell from 0
    | tolerance: 1e-400
    |            ^
  got: '1e-400'
  expected: a number of at least 0
  hint: the smallest number above 0 is 5e-324; for zero write 0
""",
    ),
    "tolerance_not_a_number": (
        "tolerance: 0.1",
        "tolerance: .nan",
        """\
scene.yaml:16:14: error.tolerance: not a finite number
    | tolerance: .nan
    |            ^
  got: .nan
  expected: a number of at least 0
""",
    ),
    "tolerance_negative": (
        "tolerance: 0.1",
        "tolerance: -1e-300",
        """\
scene.yaml:16:14: error.tolerance: out of range
    | tolerance: -1e-300
    |            ^
  got: -1e-300
  expected: a number of at least 0
""",
    ),
    "tolerance_by_list": (
        "tolerance: 0.1",
        "tolerance: [0.5, 0.1]",
        """\
scene.yaml:16:14: error.tolerance: not a number
    | tolerance: [0.5, 0.1]
    |            ^
  got: [0.5, 0.1]
  expected: a number of at least 0
""",
    ),
    "tolerances_by_frame": (
        "tolerance: 0.1",
        "tolerance: {0: much, 5: .inf, 7: -1, 9: true}",
        """\
scene.yaml:16:18: error.tolerance.0: not a number
    | tolerance: {0: much, 5: .inf, 7: -1, 9: true}
    |                ^
  got: 'much'
  expected: a number of at least 0
scene.yaml:16:27: error.tolerance.5: not a finite number
    | tolerance: {0: much, 5: .inf, 7: -1, 9: true}
    |                         ^
  got: .inf
  expected: a number of at least 0
scene.yaml:16:36: error.tolerance.7: out of range
    | tolerance: {0: much, 5: .inf, 7: -1, 9: true}
    |                                  ^
  got: -1
  expected: a number of at least 0
scene.yaml:16:43: error.tolerance.9: not a number
    | tolerance: {0: much, 5: .inf, 7: -1, 9: true}
    |                                         ^
  got: true
  expected: a number of at least 0
""",
    ),
    "zero_by_frame": (
        "tolerance: 0.1",
        "tolerance: {0: 0.5, 60: 0}",
        """\
scene.yaml:16:27: error.tolerance.60: 0 in a tolerance by frame, with frames between it and another
    | tolerance: {0: 0.5, 60: 0}
    |                         ^
  got: {0: 0.5, 60: 0}
  expected: a number greater than 0
  hint: it is interpolated in the logarithm; {0: 0.5, 59: 0.5, 60: 0} goes from one to the other at once
""",
    ),
    "zero_then_another": (
        "tolerance: 0.1",
        "tolerance: {0: 0, 60: 0.5}",
        """\
scene.yaml:16:18: error.tolerance.0: 0 in a tolerance by frame, with frames between it and another
    | tolerance: {0: 0, 60: 0.5}
    |                ^
  got: {0: 0, 60: 0.5}
  expected: a number greater than 0
  hint: it is interpolated in the logarithm; {0: 0, 59: 0, 60: 0.5} goes from one to the other at once
""",
    ),
    "tolerance_after_the_end": (
        "tolerance: 0.1",
        "tolerance: {0: 0.5, 120: 0.1}",
        """\
scene.yaml:16:23: error.tolerance.120: after the last frame
    | tolerance: {0: 0.5, 120: 0.1}
    |                     ^
  got: 120
  expected: a frame from 0 to 119
""",
    ),
    "bad_frame": (
        "tolerance: 0.1",
        "tolerance: {first: 0.5}",
        """\
scene.yaml:16:15: error.tolerance.first: not a whole number
    | tolerance: {first: 0.5}
    |             ^
  got: 'first'
  expected: a whole number from 0 to 999999
""",
    ),
}


@pytest.mark.parametrize(("old", "new", "message"), CASES.values(), ids=CASES)
def test_message(complaint: Callable[[str, str], str], old: str, new: str, message: str) -> None:
    assert complaint(old, new) + "\n" == message
