"""Whole messages about schedules: budgets, accuracies, several at once, and their frames."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from renderer.errors import InputError
from renderer.scene import SplatBudget, load_scene

# In place of `tolerance: 0.1`: what is said.
CASES = {
    "splats: 0": """\
scene.yaml:16:11: error.splats: a budget of 0
    | splats: 0
    |         ^
  got: 0
  expected: a whole number from 1 to 1000000000000
  hint: 1 is the whole volume as one splat; tolerance: 0 has no limit
""",
    "seconds: 0": """\
scene.yaml:16:12: error.seconds: a budget of 0
    | seconds: 0
    |          ^
  got: 0
  expected: a number from 0.0001 to 86400
  hint: it is the time for each frame; the quickest is splats: 1
""",
    "psnr: 0": """\
scene.yaml:16:9: error.psnr: an accuracy of 0
    | psnr: 0
    |       ^
  got: 0
  expected: a number greater than 0 and at most 200
  hint: it is in decibels, the more the better: at 30 flaws are seen, at 40 hardly any
""",
    "rmse: 0.0": """\
scene.yaml:16:9: error.rmse: an accuracy of 0
    | rmse: 0.0
    |       ^
  got: 0
  expected: a number greater than 0 and at most 1
  hint: nothing is as exact as that; tolerance: 0 draws every voxel
""",
    "splats: {0: 1000, 60: 0, 119: -5}": """\
scene.yaml:16:25: error.splats.60: a budget of 0
    | splats: {0: 1000, 60: 0, 119: -5}
    |                       ^
  got: 0
  expected: a whole number from 1 to 1000000000000
  hint: 1 is the whole volume as one splat; tolerance: 0 has no limit
scene.yaml:16:33: error.splats.119: out of range
    | splats: {0: 1000, 60: 0, 119: -5}
    |                               ^
  got: -5
  expected: a whole number from 1 to 1000000000000
""",
    "splats: 1.5": """\
scene.yaml:16:11: error.splats: not a whole number
    | splats: 1.5
    |         ^
  got: 1.5
  expected: a whole number from 1 to 1000000000000
""",
    "seconds: {}": """\
scene.yaml:16:12: error.seconds: empty
    | seconds: {}
    |          ^
  expected: a number from 0.0001 to 86400, or by frame, such as {0: 0.1, 60: 2}
""",
    "psnr: {0: 30}": """\
scene.yaml:16:9: error.psnr: not a number
    | psnr: {0: 30}
    |       ^
  got: {0: 30}
  expected: a number greater than 0 and at most 200
""",
    "splats: {60: 1000, 30: 5000, '030': 4}": """\
scene.yaml:16:22: error.splats.30: frames out of order
    | splats: {60: 1000, 30: 5000, '030': 4}
    |                    ^
  got: 30 after 60
  expected: frames in ascending order
scene.yaml:16:32: error.splats.030: the same frame twice
    | splats: {60: 1000, 30: 5000, '030': 4}
    |                              ^
  got: 30
""",
    "seconds: {0: 1, -3: 2, 120: 3}": """\
scene.yaml:16:19: error.seconds.-3: out of range
    | seconds: {0: 1, -3: 2, 120: 3}
    |                 ^
  got: -3
  expected: a whole number from 0 to 999999
scene.yaml:16:26: error.seconds.120: after the last frame
    | seconds: {0: 1, -3: 2, 120: 3}
    |                        ^
  got: 120
  expected: a frame from 0 to 119
""",
    "tolerance: 0.1\n  psnr: 40": """\
scene.yaml:17:3: error.psnr: a second schedule beside tolerance
    | psnr: 40
    | ^
  expected: one of tolerance, splats, seconds, psnr or rmse
  hint: leave one out, as --set error.tolerance=null does
""",
    "seconds: 0.1\n  splats: 0\n  rmse: 0.1": """\
scene.yaml:17:3: error.splats: a second schedule beside seconds
    | splats: 0
    | ^
  expected: one of tolerance, splats, seconds, psnr or rmse
  hint: leave one out, as --set error.seconds=null does
scene.yaml:17:11: error.splats: a budget of 0
    | splats: 0
    |         ^
  got: 0
  expected: a whole number from 1 to 1000000000000
  hint: 1 is the whole volume as one splat; tolerance: 0 has no limit
scene.yaml:18:3: error.rmse: a second schedule beside seconds
    | rmse: 0.1
    | ^
  expected: one of tolerance, splats, seconds, psnr or rmse
  hint: leave one out, as --set error.seconds=null does
""",
    "splat: 5000": """\
scene.yaml:16:3: error.splat: unknown key
    | splat: 5000
    | ^
  expected: tolerance, splats, seconds, psnr, rmse, measure, of or finest_level
  hint: did you mean splats?
""",
    "tolerance: 0.1\n  second: 5": """\
scene.yaml:17:3: error.second: unknown key
    | second: 5
    | ^
  expected: tolerance, splats, seconds, psnr, rmse, measure, of or finest_level
  hint: did you mean seconds?
""",
}


@pytest.mark.parametrize(("written", "message"), CASES.items(), ids=CASES)
def test_message(complaint: Callable[[str, str], str], written: str, message: str) -> None:
    assert complaint("tolerance: 0.1", written) + "\n" == message


def test_an_error_that_is_no_mapping_is_one_complaint(complaint: Callable[[str, str], str]) -> None:
    assert complaint("error:\n  measure: optical\n  tolerance: 0.1\n", "error: 0.1\n") == (
        "scene.yaml:14:8: error: not a mapping\n"
        "    | error: 0.1\n"
        "    |        ^\n"
        "  got: 0.1\n"
        "  expected: a mapping with tolerance, splats, seconds, psnr, rmse, measure, of or finest_level"
    )


@pytest.mark.usefixtures("scene_folder")
def test_a_second_schedule_on_the_command_line() -> None:
    with pytest.raises(InputError) as caught:
        load_scene(Path("scene.yaml"), overrides=["error.splats=1000"])
    assert str(caught.value) == (
        "--set error.splats=1000: error.splats: a second schedule beside tolerance\n"
        "  expected: one of tolerance, splats, seconds, psnr or rmse\n"
        "  hint: leave one out, as --set error.tolerance=null does"
    )
    with pytest.raises(InputError) as caught:
        load_scene(Path("scene.yaml"), overrides=["error={seconds: 0.1, psnr: 40}"])
    assert str(caught.value) == (
        "--set error={seconds: 0.1, psnr: 40}: error.psnr: a second schedule beside seconds\n"
        "  expected: one of tolerance, splats, seconds, psnr or rmse\n"
        "  hint: leave one out, as --set error.seconds=null does"
    )
    overrides = ["error.splats=1000", "error.tolerance=null"]
    assert load_scene(Path("scene.yaml"), overrides=overrides).error.goal == SplatBudget(((0, 1000),))
