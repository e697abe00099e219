"""Editors take all scenes of the repository, and find the line of a mistake; each key of a scene has its text."""

from __future__ import annotations

import functools
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from broken_scenes import GOOD, MISTAKES, broken
from gallery_page import gallery_scenes

from hsplat_cli.scenes import SCHEMA_FILE, SCHEMA_LINE, schema_content, write_schema
from renderer.errors import InputError, Problem, SceneError
from renderer.scene import (
    SECTIONS,
    explain_key,
    load_scene,
    parse_yaml,
    scene_keys,
    scene_schema,
    schema,
)

ROOT = Path(__file__).resolve().parents[2]
VALIDATOR = jsonschema.Draft7Validator(scene_schema())


def as_json(data: Any) -> Any:
    """Return the data of a YAML text with texts as keys, as editors have them."""
    if isinstance(data, dict):
        return {str(key): as_json(item) for key, item in data.items()}
    return [as_json(item) for item in data] if isinstance(data, list) else data


def errors_in(text: str) -> list[Any]:
    return list(VALIDATOR.iter_errors(as_json(parse_yaml(text).data)))


def paths_of(error: Any, data: Any) -> Iterator[str]:
    """Yield the dotted paths of all places in `data` that an error may be in, in any alternative."""
    parts = [*error.absolute_path]
    if error.validator == "additionalProperties":
        known = error.schema.get("properties", {}).keys()
        yield from (".".join(map(str, [*parts, key])) for key in error.instance if key not in known)
    elif error.validator is None:  # a key that another one excludes
        place = functools.reduce(lambda part, key: part[key], parts, data)
        yield from (".".join(map(str, [*parts, key])) for key in place if place[key] == error.instance)
    else:
        yield ".".join(map(str, parts))
    for each in error.context:
        yield from paths_of(each, data)


def test_the_schema_is_one() -> None:
    """Its title is the label by which editors offer all needed keys at once; else the label is `object`."""
    jsonschema.Draft7Validator.check_schema(scene_schema())
    assert scene_schema()["title"] == "scene"


def test_every_scene_of_the_repository_is_right() -> None:
    files = [*ROOT.glob("configs/*.yaml"), *ROOT.glob("tests/*/scenes/*.yaml"), *ROOT.glob("tests/*/scene.yaml")]
    texts = {str(file.relative_to(ROOT)): file.read_text("utf-8") for file in files} | gallery_scenes() | {"good": GOOD}
    for page in ("README.md", "docs/scene.md"):
        texts[page] = re.findall(r"```yaml\n(.*?)```", (ROOT / page).read_text("utf-8"), re.DOTALL)[0]
    assert len(texts) > 50
    assert [(name, error.message) for name, text in texts.items() for error in errors_in(text)] == []


@pytest.mark.parametrize("name", MISTAKES)
def test_the_line_of_a_mistake_is_found(name: str, tmp_path: Path) -> None:
    """It is a mistake to hsplat, too."""
    text, line = broken(name)
    locations = parse_yaml(text).locations
    data = as_json(parse_yaml(text).data)
    paths = [path for error in VALIDATOR.iter_errors(data) for path in paths_of(error, data)]
    assert line in {locations[path].key.line for path in paths}
    (tmp_path / "scene.yaml").write_text(text, "utf-8")
    with pytest.raises(SceneError) as caught:
        load_scene(tmp_path / "scene.yaml")
    assert f"scene.yaml:{line}:" in str(caught.value)


@pytest.fixture(autouse=True)
def _scan(tmp_path: Path) -> None:
    (tmp_path / "scan.nrrd").touch()


def test_the_good_scene_is_one(tmp_path: Path) -> None:
    (tmp_path / "scene.yaml").write_text(GOOD, "utf-8")
    load_scene(tmp_path / "scene.yaml")


def test_every_key_has_its_text() -> None:
    """A sentence, and what holds if it is left out, or that it is needed, or that it takes the place of another key."""
    for key, field in scene_keys():
        text = field.text
        assert text is not None and re.fullmatch(r"[A-Z`].*\.", text.sentence), key
        assert field.plain_schema(True), key
        assert (field.default is None or not text.default) and schema.example_of(field), key


def test_every_default_and_example_is_right() -> None:
    for key, field in scene_keys():
        shape = schema.key_schema(key, field)
        for value in [*([] if field.default is None else [field.default]), *shape.get("examples", [])]:
            jsonschema.validate(as_json(value), shape, jsonschema.Draft7Validator)


def test_completing_a_section_writes_no_defaults() -> None:
    """Editors write the keys of a section whose default stands beside their title."""
    parts = [*_mappings(scene_schema())]
    assert [each for each in parts if "default" in each]
    assert not [each for each in parts if "title" in each and "default" in each]


def test_editors_can_write_every_example() -> None:
    """They write `[object Object]` for an item of a list, drop the quotes of a text, and write 0 without an example."""
    shapes = {key: schema.key_schema(key, field) for key, field in scene_keys()}
    examples = [example for shape in shapes.values() for example in shape.get("examples", [])]
    assert not [each for each in examples if isinstance(each, list) and any(isinstance(it, list | dict) for it in each)]
    assert not [each for each in examples if isinstance(each, dict) and any("#" in str(it) for it in each.values())]
    numbers = {key: shape for key, shape in shapes.items() if shape.get("type") in ("number", "integer")}
    assert numbers and all("examples" in shape for shape in numbers.values())
    assert shapes["output.quality"]["examples"] == [8]


def _mappings(part: Any) -> Iterator[dict[str, Any]]:
    """Yield the mappings inside of a JSON Schema, with those inside of lists."""
    if isinstance(part, dict):
        yield part
        part = [*part.values()]
    for item in part if isinstance(part, list) else ():
        yield from _mappings(item)


@pytest.mark.parametrize(
    "value", ["it's 5 m", 'a "b"', "x" * 90, "null", "True", "-z", "a: b", [1.5, True], {"a": "#0"}]
)
def test_plain_data_on_one_line_is_the_same_data(value: Any) -> None:
    assert parse_yaml(schema.yaml_flow(value)).data == value


def test_every_default_and_example_is_read(tmp_path: Path) -> None:
    """Also those that contradict nothing in the schema, but each other."""
    for name in ("scan.nhdr", "labels.ctbl", "institute.png", "NotoSansCJK-Regular.otf"):
        (tmp_path / name).touch()
    with (tmp_path / "a.raw").open("wb") as file:
        file.truncate(2 * 128 * 128 * 64)
    for key, field in scene_keys():
        problems: list[Problem] = []
        example = parse_yaml(schema.example_of(field)).data
        field.read(schema.TreeNode(example, key, problems, tmp_path, film=schema.FilmTime(120, 30.0)))
        assert [str(problem) for problem in problems] == [], key


def test_a_key_is_explained() -> None:
    assert explain_key("light.key.radius") == [
        "light.key.radius: The angular radius of the key light, in degrees: a larger one makes softer shadows.",
        "  Value: a number from 0.1 to 90.",
        "  Default: 14.",
    ]
    assert "  Needed." not in explain_key("camera.path.keys.frame"), "not of a flight"
    assert [line.partition(":")[0] for line in explain_key("")] == [*SECTIONS]
    assert explain_key("volumes.3.weight") == explain_key("volumes.weight")


@pytest.mark.parametrize(
    ("key", "near"),
    [
        ("volume.levl", "volume.level"),
        ("radius", "light.key.radius"),
        ("camera.path.swinge", "camera.path.swing"),
        ("wobbling", None),
    ],
)
def test_a_wrong_key_has_a_near_one(key: str, near: str | None) -> None:
    with pytest.raises(InputError) as caught:
        explain_key(key)
    assert caught.value.hint == (near and f"did you mean {near}?")


def test_the_line_for_editors_changes_no_scene(tmp_path: Path) -> None:
    """And the schema that it names is the one that a command prints."""

    scenes = []
    for name, text in (("a", GOOD), ("b", SCHEMA_LINE + GOOD)):
        (tmp_path / f"{name}.yaml").write_text(text, "utf-8")
        scenes.append(load_scene(tmp_path / f"{name}.yaml"))
    assert scenes[0].at(0) == scenes[1].at(0)
    write_schema(tmp_path / SCHEMA_FILE)
    assert (tmp_path / SCHEMA_LINE.rpartition("=")[2].strip()).read_bytes() == schema_content()


def test_a_file_that_is_no_schema_is_kept(tmp_path: Path) -> None:

    (tmp_path / "hsplat.schema.json").write_text("{}", "utf-8")
    with pytest.raises(InputError, match="no schema of scenes"):
        write_schema(tmp_path / "hsplat.schema.json")
    assert (tmp_path / "hsplat.schema.json").read_text("utf-8") == "{}"
