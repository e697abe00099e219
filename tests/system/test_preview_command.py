"""`hsplat preview`: one page that stands alone, of a scene or of a volume, and lines of it that make its pictures."""

from __future__ import annotations

import base64
import html
import io
import json
import re
from pathlib import Path

import nrrd
import numpy as np
import pytest
import yaml
from html_page import Page, assert_can_be_heard, assert_sound_and_alone
from kinds_of_data import ball, head_in_hounsfield_units
from PIL import Image
from small_scene import contents, small_scene

import renderer
from hsplat_cli import main
from renderer.scene import parse_scene
from renderer.suggest import PRESET_WORDS

pytestmark = pytest.mark.usefixtures("folder")

SCENE = small_scene(frames=5, size="64, 48", error="tolerance: {0: 0.5, 4: 0.1}")
HOSTILE = "<script>alert('x')</script> {{ 7 * 7 }} \"&"
TWO = f"""
volumes:
  - {{name: {json.dumps(HOSTILE)}, procedural: {{name: engine_block, shape: [16, 16, 8]}}, color: red, range: [50, 200]}}
  - {{file: labels.npy, labels: {{show: [1, 2]}}, weight: 0.5}}
annotation: {{title: {json.dumps(HOSTILE)}, scale_bar: true}}
camera: {{path: [{{type: rocker, frames: 9}}, {{type: hold, frames: 4}}], loop: ping-pong}}
error: {{psnr: 40}}
output: {{file: film.mp4, size: [64, 48], background: {{top: white, bottom: navy}}}}
"""  # noqa: E501
MOVING = SCENE.replace("elevation: 20", "elevation: {0: 0, 4: 60}").replace(
    "film.mp4", "film.webp\n  background: transparent"
)
MOVING += "splat: {footprint: gaussian}\n"


def page_of(source: str, *options: str) -> str:
    """Preview a source; require what holds for every page."""
    assert main.run(["preview", source, "-o", "page.html", "--quiet", *options]) == 0
    text = Path("page.html").read_text("utf-8")
    assert_sound_and_alone(text)
    assert_can_be_heard(text)
    assert len(text) < 3_000_000 and "alert('x')</script>" not in text
    return text


def lines_of(text: str) -> list[dict[str, object]]:
    """Return the lines of each variant as plain data."""
    return [yaml.safe_load(html.unescape(block)) for block in re.findall(r"<pre>(.*?)</pre>", text, re.DOTALL)]


def picture_of(text: str, caption: str) -> np.ndarray:
    found = re.search(rf'src="data:image/webp;base64,([^"]*)" alt="{caption}:', text)
    assert found is not None
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(found[1]))), np.float64)


@pytest.mark.slow
def test_a_scene_and_the_lines_of_its_variants() -> None:
    Path("scene.yaml").write_text(SCENE, encoding="utf-8")
    text, tree = page_of("scene.yaml"), yaml.safe_load(SCENE)
    assert [f"frame {k}" in Page(text).prose for k in range(6)] == [True] * 5 + [False]
    for sections in lines_of(text):
        merged = {key: {**(tree.get(key) or {}), **value} for key, value in sections.items() if isinstance(value, dict)}
        parse_scene({**tree, **sections, **merged}, base=Path())
    assert lines_of(text)[2] == {"transfer_function": {"unit": 0.5}}
    twice = page_of("scene.yaml", "--set", "transfer_function.unit=0.5")
    assert np.abs(picture_of(twice, "opacity × 1") - picture_of(text, "opacity × 2")).mean() < 0.5
    assert np.abs(picture_of(text, "opacity × 1") - picture_of(text, "opacity × 2")).mean() > 2
    assert "a turn in 24 pictures" in Page(text).prose.lower() and "from 90" in Page(text).prose


def test_variants_of_thin_matter_are_around_the_unit_that_makes_it_visible() -> None:
    Path("scene.yaml").write_text(SCENE, encoding="utf-8")
    text = page_of("scene.yaml", "--set", "transfer_function.unit=60")
    (unit,) = re.findall(r"--set transfer_function\.unit=(\S+) \(now 60\)", Page(text).prose)
    units = [60 / float(caption) for caption in re.findall(r">opacity × ([0-9.]+)", text)]
    assert units == pytest.approx([2 * float(unit), float(unit), float(unit) / 2], rel=0.01)
    stated = [lines["transfer_function"] for lines in lines_of(text) if "transfer_function" in lines][:3]
    assert stated == [{"unit": pytest.approx(each, rel=0.01)} for each in units]


@pytest.mark.parametrize(
    ("axes", "captions"),
    [
        (
            [[0, 2, 0], [-1, 0, 0], [0, 0, 1]],
            [
                "voxel x = 8, world y = 36 mm; world x 18.5 to 2.5 to the right, world z -0.5 to 11.5 upwards",
                "voxel y = 8, world x = 10 mm; world y 19 to 51 to the right, world z -0.5 to 11.5 upwards",
                "voxel z = 6, world z = 6 mm; world y 19 to 51 to the right, world x 18.5 to 2.5 upwards",
            ],
        ),
        (
            [[0.8, 0.6, 0], [-0.6, 0.8, 0], [0, 0, 1]],
            ["voxel x = 8, through [19.6, 31.2, 6] in the world; y to the right, z upwards"],
        ),
    ],
    ids=["swapped and flipped", "oblique"],
)
def test_slices_say_where_in_the_world_they_are(axes: list[list[float]], captions: list[str]) -> None:
    header = {"space": "left-posterior-superior", "space directions": axes, "space origin": [18, 20, 0]}
    header |= {"space units": ["mm"] * 3}
    nrrd.write("a.nrrd", ball((0, 0, 0), 0.8, 16)[2:14].astype(np.uint8).transpose() * 200, header)
    prose = Page(page_of("a.nrrd", "--size", "32", "--frames", "2")).prose
    assert [caption for caption in captions if caption not in prose] == []


@pytest.mark.slow
def test_volumes_labels_and_what_moves() -> None:
    np.save("head.npy", head_in_hounsfield_units())
    labels = 1 * ball((0, 0, 0), 0.8, 24) + ball((0, 0, 0.3), 0.4, 24)
    np.save("labels.npy", labels.astype(np.uint8))
    text = page_of("head.npy", "--size", "64")
    assert [word for word in PRESET_WORDS if f"--preset {word}" in text] == ["bone", "vessels", "skin", "xray"]
    text = page_of("labels.npy", "--size", "64")
    assert "label 2" in text and "--preset" not in text
    Path("two.yaml").write_text(TWO, encoding="utf-8")
    text = page_of("two.yaml")
    assert (
        "in place of its goal" in text
        and HOSTILE in Page(text).prose
        and lines_of(text)[2] == {"volumes": [{"weight": 2}, {"weight": 1}]}
    )
    Path("moving.yaml").write_text(MOVING, encoding="utf-8")
    assert "Frame 2 with other lines" in page_of("moving.yaml")


@pytest.mark.slow
def test_a_notebook_shows_the_page_of_an_array() -> None:
    page = renderer.preview(renderer.suggest_scene(ball((0, 0, 0), 0.8, 16) * 1, size=(32, 32), output="film.gif"))
    assert_sound_and_alone(page.html)
    shown = page._repr_html_()
    assert html.unescape(shown.partition('srcdoc="')[2].partition('"')[0]) == page.html and not contents()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["scan.npy", "-o", "page.txt"], "not a name for a report"),
        (["scan.npy", "-o", "link.html"], "this output would overwrite an input"),
        (["scene.yaml", "--frames", "9"], "--frames: this is for a volume without a scene"),
        (["scene.yaml", "--size", "9"], "without a scene\n  hint: --set 'output.size=[512, 512]'\n"),
        (["scan.npy", "--set", "output.size=[0, 8]"], "output.size.0"),
    ],
)
def test_wrong_arguments_write_nothing(arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    Path("scene.yaml").write_text(SCENE, encoding="utf-8")
    np.save("scan.npy", np.arange(216, dtype=np.uint8).reshape(6, 6, 6))
    Path("link.html").hardlink_to("scan.npy")
    before = contents()
    assert main.run(["preview", *arguments]) == 2
    assert message in capsys.readouterr().err and contents() == before
