"""A scene file is read with the place of each value, and options change it; any other text raises InputError."""

from __future__ import annotations

import math
import random
from pathlib import Path
from typing import Any

import pytest
import yaml
from film_stages import scheduled
from hypothesis import given, settings, strategies as st

from renderer.errors import InputError
from renderer.scene import FileSource, NotYamlError, Scene, load_scene, parse_yaml, scene_to_dict

ROOT = Path(__file__).resolve().parents[2]
CONFIGS = sorted((ROOT / "configs").glob("*.yaml"))
DEMO = ROOT / "configs" / "demo.yaml"


def load(path: Path, *overrides: str, **options: Any) -> Scene:
    return load_scene(path, overrides=overrides, **options)


# YAML


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e-3", 0.001), ("1E3", 1000.0), (".5", 0.5), ("-3.", -3.0), ("010", 10), ("+7", 7), ("-.inf", -math.inf),
        ("1:30", "1:30"), ("0x10", "0x10"), ("1_000", "1_000"), ("yes", "yes"), ("off", "off"), ("True", True),
        ("~", None), ("null", None), ("'1'", "1"), ("2024-01-01", "2024-01-01"), ("e3", "e3"), (".", "."),
        ("-", [None]), ("9" * 5000, math.inf),
    ],
)  # fmt: skip
def test_scalars_are_those_of_yaml_1_2(text: str, value: object) -> None:
    data = parse_yaml(text).data
    assert data == value
    assert type(data) is type(value)


def test_every_value_has_its_place() -> None:
    tree = parse_yaml("a: 1\nb:\n  c: [2,\n      3]\n  d:\n  - x\n  - {e: y}\n")
    assert tree.data == {"a": 1, "b": {"c": [2, 3], "d": ["x", {"e": "y"}]}}
    places = {path: (*location.key, *location.value) for path, location in tree.locations.items()}
    assert places == {
        "": (1, 1, 1, 1),
        "a": (1, 1, 1, 4),
        "b": (2, 1, 2, 1),
        "b.c": (3, 3, 3, 6),
        "b.c.0": (3, 7, 3, 7),
        "b.c.1": (4, 7, 4, 7),
        "b.d": (5, 3, 5, 3),
        "b.d.0": (6, 5, 6, 5),
        "b.d.1": (7, 5, 7, 5),
        "b.d.1.e": (7, 6, 7, 9),
    }


def test_an_anchor_is_copied_wherever_it_is_used() -> None:
    tree = parse_yaml("a: &x [1, 2]\nb: *x\n")
    assert tree.data == {"a": [1, 2], "b": [1, 2]}
    assert tree.data["a"] is not tree.data["b"]


@pytest.fixture
def max_nodes(monkeypatch: pytest.MonkeyPatch) -> int:
    """Allow fewer values, which take less time."""
    monkeypatch.setattr("renderer.scene.yaml_tree.MAX_NODES", 100)
    return 100


@pytest.mark.parametrize("item", ["a", "{k: v}", "{[k, k]: v}", "*anchor"])
def test_too_many_values_are_refused_before_they_are_composed(item: str, max_nodes: int, monkeypatch) -> None:
    num_composed = 0
    compose = yaml.composer.Composer.compose_node

    def counted(*arguments: Any) -> Any:
        nonlocal num_composed
        num_composed += 1
        return compose(*arguments)

    monkeypatch.setattr("yaml.composer.Composer.compose_node", counted)
    with pytest.raises(NotYamlError, match="more than 100 values"):
        parse_yaml(f"[&anchor b{f', {item}' * 1000}]")
    assert num_composed <= 2 * max_nodes  # each value of a mapping has a key


def test_keys_do_not_count_as_values(max_nodes: int) -> None:
    keys = [f"k{number}" for number in range(max_nodes - 1)]  # the mapping is a value, too
    assert list(parse_yaml("\n".join(f"{key}:" for key in keys)).data) == keys
    with pytest.raises(NotYamlError, match="more than 100 values"):
        parse_yaml("\n".join(f"{key}:" for key in [*keys, "one_more"]))


TREES = st.recursive(
    st.none() | st.booleans() | st.integers(-(10**9), 10**9) | st.floats(allow_nan=False) | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=12,
)


@settings(max_examples=25, deadline=None, derandomize=True)
@given(data=TREES, flow=st.booleans())
def test_any_data_that_pyyaml_writes_read_back(data: object, flow: bool) -> None:
    tree = parse_yaml(yaml.safe_dump(data, allow_unicode=True, default_flow_style=flow))
    assert tree.data == data
    assert tree.problems == []


# Examples


@pytest.mark.parametrize("path", CONFIGS, ids=lambda path: path.name)
def test_every_example_is_a_correct_scene(path: Path) -> None:
    text = path.read_text("utf-8")
    overrides = [f"volumes.{number}.file={__file__}" for number in range(text.count("\n    file: "))]
    scene = load(path, *overrides, volume=Path(__file__) if "\nvolume:\n  file:" in text else None)
    assert scene.output.file.stem in (path.stem, "{frame:04}")


def test_a_resolved_scene_is_a_scene_file(tmp_path: Path) -> None:
    scene = load(ROOT / "configs" / "ct_head.yaml", volume=Path(__file__))
    (tmp_path / "resolved.yaml").write_text(yaml.safe_dump(scene_to_dict(scene)), encoding="utf-8")
    assert load(tmp_path / "resolved.yaml") == scene


# Options


def test_overrides_apply_in_their_order() -> None:
    scene = load(
        DEMO,
        "camera.path.frames=3",
        "camera.path.frames=10",
        "error.tolerance={}",
        "error.tolerance.0=1",
        "error.tolerance.5=1e-1",
        "shading.ambient=0.5",
        "output.background=#ff0000",
        "transfer_function.points.1.value=61",
        "output.frames_per_second=null",
        "output.file=a=b.mp4",
    )
    assert scene.camera.path.frames == 10
    assert scene.error.tolerance == scheduled((0, 1.0), (5, 0.1))
    assert scene.layers[0].shading is not None
    assert scene.layers[0].shading.ambient == 0.5
    assert scene.output.background == (1.0, 0.0, 0.0)
    assert isinstance(scene.layers[0].transfer_function.mapping, tuple)
    assert scene.layers[0].transfer_function.mapping[1].value == 61
    assert scene.output.frames_per_second == 30
    assert scene.output.file == Path("a=b.mp4")


def test_overrides_reach_keys_that_are_numbers() -> None:
    scene = load(DEMO, "error.tolerance={0: 0.5, 40: 0.1}", "error.tolerance.40=0.2")
    assert scene.error.tolerance == scheduled((0, 0.5), (40, 0.2))


def test_the_volume_option_keeps_the_rest_of_the_section(folder: Path) -> None:
    (folder / "scenes").mkdir()
    (folder / "scan.nrrd").touch()
    text = DEMO.read_text(encoding="utf-8").replace(
        "volume:", "volume:\n  crop: [[0, 2], [0, 2], [0, 2]]\n  nodata: none"
    )
    (folder / "scenes" / "scene.yaml").write_text(text, encoding="utf-8")
    scene = load(Path("scenes/scene.yaml"), volume=Path("scan.nrrd"), output=Path("frames/{frame}.png"))
    assert scene.layers[0].volume.source == FileSource(folder / "scan.nrrd")
    assert scene.layers[0].volume.crop == ((0, 2), (0, 2), (0, 2))
    assert scene.layers[0].volume.nodata == "none"
    assert scene.output.file == Path("frames/{frame}.png")


def test_the_volume_option_replaces_any_volume(tmp_path: Path) -> None:
    text = DEMO.read_text(encoding="utf-8")
    first, last = text.index("volume:"), text.index("# What a value")
    for volume in ("", "volume: {raw: {file: gone.raw}}\n", "volume: gone.nrrd\n", "volume:\n"):
        (tmp_path / "scene.yaml").write_text(text[:first] + volume + text[last:], encoding="utf-8")
        assert load(tmp_path / "scene.yaml", volume=Path(__file__)).layers[0].volume.source == FileSource(
            Path(__file__).absolute()
        )


def test_files_are_relative_to_the_scene(folder: Path) -> None:
    (folder / "scenes").mkdir()
    (folder / "scenes" / "scan.nrrd").touch()
    text = (ROOT / "configs" / "engine.yaml").read_text(encoding="utf-8").replace("engine.nhdr  ", "scan.nrrd  ")
    (folder / "scenes" / "scene.yaml").write_text(text, encoding="utf-8-sig")
    assert load(Path("scenes/scene.yaml")).layers[0].volume.source == FileSource(folder / "scenes" / "scan.nrrd")


# Anything at all

SNIPPETS = [
    ":", " ", "\n", "\n  ", "- ", "{", "}", "[", "]", ",", "&a ", "*a", "!!int ", "!x ", "'", '"', "#", "|\n", ">\n",
    "\t", "\\", '"\\UFFFFFFFF"', "%YAML 1.1\n", "---\n", "...\n", "? ", "~", "<<: ", "\ufeff", "\x07", "\u2028", "é",
    "version: 2\n", "camera:\n", "path:", "1e999", "nan", ".inf", "9" * 5000, "\x00",
]  # fmt: skip


def test_spoilt_files_are_refused_with_a_message(tmp_path: Path) -> None:
    text = DEMO.read_text(encoding="utf-8")
    choose, path = random.Random(2), tmp_path / "scene.yaml"
    num_complaints = 0
    for _ in range(100):
        spoilt = text
        for _ in range(choose.randint(1, 3)):
            begin = choose.randrange(len(spoilt))
            spoilt = spoilt[:begin] + choose.choice(SNIPPETS) + spoilt[begin + choose.choice([0, 0, 1, 9]) :]
        path.write_text(spoilt, encoding="utf-8")
        num_complaints += complains(path)
    assert num_complaints > 50


@settings(max_examples=60, deadline=None, derandomize=True)
@given(text=st.lists(st.sampled_from([*SNIPPETS, "camera", "output", "=", ".", "0"]), max_size=8).map("".join))
def test_any_override_is_applied_or_refused(text: str) -> None:
    complains(DEMO, text)


def complains(path: Path, *overrides: str) -> bool:
    try:
        load(path, *overrides)
    except InputError as error:
        return bool(str(error))
    return False
