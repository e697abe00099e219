"""Whole messages about keys and kinds of values."""

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
    "decimal_comma": (
        "  tolerance: 0.1",
        "  tolerance: 0,1",
        """\
scene.yaml:16:14: error.tolerance: not a number
    | tolerance: 0,1
    |            ^
  got: '0,1'
  expected: a number of at least 0
  hint: decimals come after a point: 0.1
""",
    ),
    "decimal_comma_in_braces": (
        '{value: 90, color: "#6680e6", opacity: 0.01}',
        '{value: 90, color: "#6680e6", opacity: 0,5}',
        """\
scene.yaml:8:48: transfer_function.points.1.5: unknown key
    | - {value: 90, color: "#6680e6", opacity: 0,5}
    |                                            ^
  expected: value, color or opacity
  hint: decimals come after a point; in {...} and [...] a comma begins what comes next
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
