"""Transfer functions with percentiles for values, and values that are matched by histograms."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from renderer.errors import InputError, SceneError
from renderer.readers import read_volume
from renderer.resolve import resolve_scene
from renderer.scene import FilmScene, Motion, parse_scene, scene_to_dict
from renderer.statistics import match_values
from renderer.volume import Array, Volume, make_volume

# 300 zeros, then 1 to 699 and a last value that is far away, in no order.
VALUES = np.random.default_rng(1).permutation(np.maximum(np.r_[0:999, 10**6 + 299] - 299, 0)).reshape(10, 10, 10)
RAMP = {"relative": True, "colormap": "gray", "range": [40, 99], "opacity": [[0, 0], [10, 0.1], [20, 0.2], [100, 1]]}


@pytest.fixture(autouse=True)
def files(folder: Path) -> None:
    """Write a volume of each type, one with absent voxels, two steps in time, and a constant one."""
    for kind in ("int32", "float32"):
        np.save(f"{kind}.npy", VALUES.astype(kind))
    np.save("absent.npy", np.concatenate([VALUES, np.full((10, 10, 10), np.nan)]))
    np.save("constant.npy", np.full((4, 4, 4), 7, np.int16))
    np.save("twice.npy", 2 * VALUES)


def resolved(transfer: dict[str, Any], file: Any = "int32.npy", **volume: Any) -> FilmScene:
    """Return a scene with values, of which its plain data are a scene, too."""
    camera, output = {"path": {"type": "turntable", "frames": 10}}, {"file": "a.mp4"}
    tree = {"transfer_function": transfer, "camera": camera, "output": output}
    one = parse_scene({**tree, "volume": {"file": file, **volume}}, base=Path())
    again = scene_to_dict(one)
    assert "import" in transfer or parse_scene(again, base=Path()) == one
    scene = resolve_scene(one, read_volume)
    plain = scene_to_dict(scene)
    assert "relative" not in plain["transfer_function"]
    assert parse_scene(plain, base=Path()) == scene
    del tree["transfer_function"]
    layers = [{"file": "constant.npy", "color": "red", "range": [0, 9]}, {"file": file, **volume}]
    layers[1]["transfer_function"] = transfer
    several = resolve_scene(parse_scene({**tree, "volumes": layers}, base=Path()), read_volume)
    looks = [each.map(lambda layer: layer.transfer_function) for each in (several.film_layers[1], scene.film_layers[0])]
    assert looks[0] == looks[1]
    return scene


def points(*pairs: tuple[Any, float]) -> dict[str, Any]:
    return {"relative": True, "points": [{"value": value, "color": "red", "opacity": part} for value, part in pairs]}


@pytest.mark.parametrize("file", ["int32.npy", "float32.npy", "absent.npy"])
def test_percentiles_become_values(file: str) -> None:
    """Three at one value become two, and the farthest value stays exact."""
    found = resolved(RAMP, file).layers[0].transfer_function.mapping
    assert (found.range, found.opacity) == ((100.0, 690.0), ((0.0, 0.0), (0.0, 0.2), (1000000.0, 1.0)))
    given = points((5, 0), (30, 0), (30.1, 0.5), (50, 0.4))
    assert [each.value for each in resolved(given, file).layers[0].transfer_function.points] == [0, 0, 1, 200]


def test_percentiles_move_and_steps_have_those_of_the_first() -> None:
    moving = points((5, 0), (10, 0.1), (20, 0.2), ({0: 50, 9: 100, "easing": "smooth"}, 0.3))
    scene = resolved(moving, ["int32.npy", "twice.npy"], time={0: 0, 9: 1})
    plain = scene_to_dict(scene)["transfer_function"]["points"]
    assert [each["value"] for each in plain] == [0, 0, {0: 200, 9: 1000000, "easing": "smooth"}]
    found = resolved({**RAMP, "range": {0: [40, 99], 9: [50, 60]}})
    assert scene_to_dict(scene)["volume"]["time"] == {0: 0, 9: 1}
    spans = found.map(lambda each: each.layers[0].transfer_function.mapping.range)
    assert spans.motions == [Motion((0, 9), ((100.0, 690.0), (200.0, 300.0)))]


def test_what_is_imported_is_stretched_between_values() -> None:
    """It is that of a scene with these values."""
    section: dict[str, Any] = {"import": "mr-head", "relative": True}
    for own, values in (({}, {}), ({"opacity": [[50, 0], [90, 1]]}, {"opacity": [[200, 0], [600, 1]]})):
        plain = {"import": "mr-head", "range": [100, 690], **values}
        found = resolved({**section, "range": [40, 99], **own}).layers[0].transfer_function
        assert found == resolved_plain(plain).layers[0].transfer_function


def resolved_plain(transfer: dict[str, Any]) -> FilmScene:
    tree = {"volume": {"file": "int32.npy"}, "output": {"file": "a.mp4"}, "transfer_function": transfer}
    return parse_scene({**tree, "camera": {"path": {"type": "turntable", "frames": 10}}}, base=Path())


WRONG: dict[str, tuple[dict[str, Any], str, str]] = {
    "above 100": ({**RAMP, "range": [40, 101]}, "int32", "transfer_function.range.1: out of range"),
    "below 0": (points((-1, 0), (5, 1)), "int32", "transfer_function.points.0.value: out of range"),
    "moves above": (points((5, 0), ({0: 9, 9: 101}, 1)), "int32", "at frame 9: out of range"),
    "an import without ends": ({"import": "mr-head", "relative": True}, "int32", "transfer_function.range: missing"),
    "an import that is shifted": (
        {"import": "ct-bone", "relative": True, "range": [9, 99], "shift": 9}, "int32", "shift: contradicts",
    ),
    "a constant volume": (RAMP, "constant", "these percentiles of constant.npy are one value"),
    "one value": (points((1, 0), (20, 1)), "int32", "these percentiles of int32.npy are one value"),
    "no range": ({**RAMP, "range": [1, 9]}, "int32", "range: not ascending, with values of int32.npy"),
    "no logarithm": ({**RAMP, "scale": "log"}, "int32", "transfer_function.opacity.0.0: no logarithm"),
    "nothing visible": (points((1, 0), (5, 1), (20, 0), (50, 0)), "int32", "every opacity is 0"),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wrong_is_told_at_its_place(case: str) -> None:
    section, name, message = WRONG[case]
    with pytest.raises(SceneError) as caught:
        resolved(section, f"{name}.npy")
    assert message in str(caught.value)


def scan(function: Any = lambda values: values, dtype: str = "float64") -> Volume:
    """Return a noisy head of two materials in air."""
    z, y, x = np.mgrid[-1:1:40j, -1:1:40j, -1:1:40j]
    radius = np.sqrt(x**2 + y**2 + z**2)
    noise = np.random.default_rng(2).normal(0, 1, radius.shape)
    values: Array = np.select([radius < 0.4, radius < 0.8], [180.0, 90.0 + 20 * x], 5.0) + noise
    return make_volume(function(values).astype(dtype), np.eye(4), name="scan.nii")


def test_scans_are_matched_by_a_line() -> None:
    """It is exact for values that a line changed, of another type within rounding, and robust: a crop has less air."""
    line = match_values(scan(), scan(lambda values: 3.7 * values + 100))
    assert (line.scale, line.shift) == pytest.approx((3.7, 100.0), rel=1e-6)
    assert str(line) == "times 3.7, plus 100"
    assert str(match_values(scan(), scan(lambda values: values * 1e-3 - 7))) == "times 0.001, minus 7"
    rounded = match_values(scan(), scan(lambda values: 3.7 * values + 100, "int16"))
    cropped = match_values(scan(), scan(lambda values: values[5:-5, 4:-4, 3:-3]))
    for value in (90.0, 180.0):
        assert rounded(value) == pytest.approx(3.7 * value + 100, rel=0.01)
        assert cropped(value) == pytest.approx(value, rel=0.03)


@pytest.mark.parametrize("values", [np.full((9, 9, 9), 3.0), np.indices((9, 9, 9))[0] // 3])
def test_what_has_no_contrast_is_not_matched(values: Array) -> None:
    other = make_volume(values, np.eye(4), name="other.nii")
    for pair in ((scan(), other), (other, scan())):
        with pytest.raises(InputError, match=r"other\.nii: nothing to match"):
            match_values(*pair)
