"""Whole messages about keys, kinds of values, the camera and the error."""

from __future__ import annotations

from collections.abc import Callable

import pytest

# What is replaced in the scene, by what, and what is said about it.
CASES = {
    "unknown_key": (
        "projection: perspective",
        "projektion: perspective",
        """\
scene.yaml:11:3: camera.projektion: unknown key
    | projektion: perspective
    | ^
  expected: projection, field_of_view, target, distance, near or path
  hint: did you mean projection?
""",
    ),
    "unknown_section": (
        "splat:",
        "splats:",
        """\
scene.yaml:17:1: splats: unknown key
    | splats:
    | ^
  expected: version, volume, transfer_function, shading, camera, error, pyramid, splat, overlay or output
  hint: did you mean splat?
""",
    ),
    "unknown_key_without_a_likeness": (
        "  unit: 1.0",
        "  42: 1.0",
        """\
scene.yaml:5:3: transfer_function.42: unknown key
    | 42: 1.0
    | ^
  expected: unit, points, colormap, range or opacity
""",
    ),
    "key_of_another_path": (
        "frames: 120, elevation",
        "frames: 120, swing: 40, elevation",
        """\
scene.yaml:13:40: camera.path.swing: unknown key
    | path: {type: turntable, frames: 120, swing: 40, elevation: 20}
    |                                      ^
  expected: type, frames, axis, start or elevation
  hint: swing belongs to type: rocker
""",
    ),
    "missing_part": (
        "type: turntable, frames: 120, ",
        "type: turntable, ",
        """\
scene.yaml:13:3: camera.path.frames: missing
    | path: {type: turntable, elevation: 20}
    | ^
  expected: a whole number from 1 to 1000000
""",
    ),
    "missing_section": (
        """\
error:
  measure: optical
  tolerance: 0.1
splat:
  footprint: gaussian
output:
  file: engine.mp4
  size: [512, 512]
  background: "#000000"
""",
        "",
        """\
scene.yaml: output: missing
  expected: a mapping with file
""",
    ),
    "missing_in_a_list": (
        '{value: 90, color: "#6680e6", opacity: 0.01}',
        "{value: 90, opacity: 0.01}",
        """\
scene.yaml:8:7: transfer_function.points.1.color: missing
    | - {value: 90, opacity: 0.01}
    |   ^
  expected: a color: "#rrggbb", "#rgb", [red, green, blue] from 0 to 1, or a name such as white
""",
    ),
    "not_a_mapping": (
        """\
splat:
  footprint: gaussian\
""",
        "splat: gaussian",
        """\
scene.yaml:17:8: splat: not a mapping
    | splat: gaussian
    |        ^
  got: 'gaussian'
  expected: a mapping with footprint, sigma, angular, radial, profile, opacity_correction or order
""",
    ),
    "section_without_content": (
        """\
  measure: optical
  tolerance: 0.1
""",
        "",
        """\
scene.yaml:14:7: error: no value
    | error:
    |       ^
  expected: a mapping with tolerance, splats, seconds, psnr, rmse, measure, of or finest_level
""",
    ),
    "unquoted_color": (
        'background: "#000000"',
        "background: #000000",
        """\
scene.yaml:22:14: output.background: no value
    | background: #000000
    |            ^
  expected: a color: "#rrggbb", "#rgb", [red, green, blue] from 0 to 1, or a name such as white, or transparent
  hint: a color that begins with # needs quotes: "#ff8800"
""",
    ),
    "bool_is_no_number": (
        "distance: 300",
        "distance: true",
        """\
scene.yaml:12:13: camera.distance: not a number
    | distance: true
    |           ^
  got: true
  expected: a number from 1e-30 to 1e+30
""",
    ),
    "not_a_number": (
        "distance: 300",
        "distance: 30 cm",
        """\
scene.yaml:12:13: camera.distance: not a number
    | distance: 30 cm
    |           ^
  got: '30 cm'
  expected: a number from 1e-30 to 1e+30
""",
    ),
    "not_finite": (
        "distance: 300",
        "distance: .inf",
        """\
scene.yaml:12:13: camera.distance: not a finite number
    | distance: .inf
    |           ^
  got: .inf
  expected: a number from 1e-30 to 1e+30
""",
    ),
    "out_of_range": (
        "distance: 300",
        "distance: -3",
        """\
scene.yaml:12:13: camera.distance: out of range
    | distance: -3
    |           ^
  got: -3
  expected: a number from 1e-30 to 1e+30
""",
    ),
    "not_whole": (
        "frames: 120",
        "frames: 12.5",
        """\
scene.yaml:13:35: camera.path.frames: not a whole number
    | path: {type: turntable, frames: 12.5, elevation: 20}
    |                                 ^
  got: 12.5
  expected: a whole number from 1 to 1000000
""",
    ),
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
    "choice": (
        "projection: perspective",
        "projection: ortographic",
        """\
scene.yaml:11:15: camera.projection: unknown value
    | projection: ortographic
    |             ^
  got: 'ortographic'
  expected: perspective or orthographic
  hint: did you mean orthographic?
""",
    ),
    "unknown_type": (
        "type: turntable",
        "type: turn-table",
        """\
scene.yaml:13:16: camera.path.type: unknown value
    | path: {type: turn-table, frames: 120, elevation: 20}
    |              ^
  got: 'turn-table'
  expected: turntable, rocker or keyframes
  hint: did you mean turntable?
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
    "value": (
        "value: 255",
        "value: 1e309",
        """\
scene.yaml:9:15: transfer_function.points.2.value: not a finite number
    | - {value: 1e309, color: white, opacity: 0.5}
    |           ^
  got: .inf
  expected: a number
""",
    ),
    "profile_without_weight": (
        "footprint: gaussian",
        "{footprint: gouraud, radial: 2, profile: [[0, 0], [0.25, 1], [0.5, 0], [1, 0]]}",
        """\
scene.yaml:18:44: splat.profile: no weight at the radii that the footprint has
    | {footprint: gouraud, radial: 2, profile: [[0, 0], [0.25, 1], [0.5, 0], [1, 0]]}
    |                                          ^
  got: [[0, 0], [0.25, 1], [0.5, 0], [1, 0]]
  expected: a weight of at least 1e-06 at one of the radii k / 2
  hint: a larger splat.radial has more radii
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
    "wrong_length": (
        "size: [512, 512]",
        "size: 512",
        """\
scene.yaml:21:9: output.size: not a list
    | size: 512
    |       ^
  got: 512
  expected: [width, height]: two whole numbers from 1 to 16384
""",
    ),
    "wrong_count": (
        "size: [512, 512]",
        "size: [512]",
        """\
scene.yaml:21:9: output.size: wrong number of items
    | size: [512]
    |       ^
  got: [512]
  expected: [width, height]: two whole numbers from 1 to 16384
""",
    ),
    "bad_item": (
        "size: [512, 512]",
        "size: [512, 20000]",
        """\
scene.yaml:21:15: output.size.1: out of range
    | size: [512, 20000]
    |             ^
  got: 20000
  expected: a whole number from 1 to 16384
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
    "version": (
        "version: 1",
        "version: 2",
        """\
scene.yaml:1:10: version: unknown version of the scene format
    | version: 2
    |          ^
  got: 2
  expected: 1
""",
    ),
}


@pytest.mark.parametrize(("old", "new", "message"), CASES.values(), ids=CASES)
def test_message(complaint: Callable[[str, str], str], old: str, new: str, message: str) -> None:
    assert complaint(old, new) + "\n" == message
