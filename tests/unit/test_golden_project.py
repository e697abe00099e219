"""The scenes of a project, the folders of their goldens, and the rules of golden.yaml."""

from __future__ import annotations

import os
from pathlib import Path
from unittest.mock import Mock

import pytest

from hsplat_cli.compare import Limit, SceneRules, find_project
from renderer.errors import InputError, SceneError
from renderer.scene import parse_yaml_file

pytestmark = pytest.mark.usefixtures("folder")


def touch(*names: str) -> None:
    for name in names:
        Path(name).parent.mkdir(parents=True, exist_ok=True)
        Path(name).touch()


def project_file(text: str, folder: str = ".") -> None:
    Path(folder).mkdir(parents=True, exist_ok=True)
    Path(folder, "golden.yaml").write_text(text, "utf-8")


def goldens_of(*places: str, goldens: str | None = None) -> dict[str, str]:
    """Return the folder of goldens of each scene, by its name."""
    project = find_project(places, None if goldens is None else Path(goldens))
    return {scene.name: scene.folder.path.as_posix() for scene in project.scenes}


def refusal(*places: str) -> str:
    with pytest.raises(InputError) as caught:
        find_project(places)
    return str(caught.value)


def test_goldens_lie_beside_scenes() -> None:
    touch("scenes/a.yaml", "scenes/b.YML", "scenes/.hidden.yaml", "scenes/notes.txt", "scenes/golden.yml", "c.yaml")
    expected = {"a": "scenes/goldens/a", "b": "scenes/goldens/b"}
    assert goldens_of("scenes") == expected
    assert goldens_of("scenes/*.*") == expected
    assert goldens_of("scenes/a.yaml", "scenes/b.YML") == expected
    assert goldens_of("scenes", goldens="kept") == {"a": "kept/a", "b": "kept/b"}
    assert goldens_of("scenes/a.yaml", "c.yaml") == {"c": "goldens/c", "scenes/a": "scenes/goldens/a"}
    assert goldens_of("scenes/a.yaml", "scenes", "scenes/../scenes/a.yaml") == expected, "each scene once"


def test_sidecars_are_scenes_where_they_are_named() -> None:
    touch("a.json", "b.yaml")
    assert goldens_of("a.json") == {"a": "goldens/a"}
    assert goldens_of(".") == {"b": "goldens/b"}


def test_scenes_outside_of_this_folder(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    touch("scenes/a.yaml", "here/x")
    monkeypatch.chdir("here")
    assert goldens_of("../scenes/a.yaml") == {"a": "../scenes/goldens/a"}
    assert goldens_of(str(folder / "scenes")) == {"a": str(folder / "scenes/goldens/a")}


def test_a_project_file_gives_scenes_goldens_and_rules() -> None:
    touch("scenes/a.yaml", "scenes/deep/b.yaml", "scenes/c.yaml", "other.yaml")
    project_file(
        "scenes: ['scenes/**/*.yaml']\ngoldens: kept\nframes: 7\nlimit: same bytes\npictures: digests\n"
        "each:\n  scenes/a.yaml: {limit: 45, pictures: files}\n  ./scenes/c.yaml: {frames: 0:10}\n"
    )
    project = find_project([])
    rules = {scene.name: scene.rules for scene in project.scenes}
    assert rules == {
        "scenes/a": SceneRules("7", Limit("decibels", 45), "files"),
        "scenes/c": SceneRules("0:10", Limit("same bytes"), "digests"),
        "scenes/deep/b": SceneRules("7", Limit("same bytes"), "digests"),
    }
    assert goldens_of(".") == {name: f"kept/{name}" for name in rules}
    given = SceneRules(frames="1", limit=Limit("decibels", 20))
    assert {scene.rules.limit for scene in find_project([], None, given).scenes} == {given.limit}


def test_a_scene_that_is_named_alone_keeps_the_rules_of_its_project(monkeypatch: pytest.MonkeyPatch) -> None:
    touch("scenes/a.yaml", "scenes/b.yaml", "other/c.yaml")
    project_file("scenes: [scenes/*.yaml]\ngoldens: kept\nlimit: 45\n")
    for place in ("scenes/a.yaml", str(Path("scenes/a.yaml").resolve())):
        (scene,) = find_project([place]).scenes
        assert (scene.name, scene.folder.path, str(scene.rules.limit)) == ("scenes/a", Path("kept/scenes/a"), "45 dB")
        assert str(scene.file) == place
    assert goldens_of("scenes") == {"scenes/a": "kept/scenes/a", "scenes/b": "kept/scenes/b"}
    assert goldens_of("other") == {"c": "other/goldens/c"}, "the project does not list it"
    monkeypatch.chdir("scenes")
    assert goldens_of("b.yaml") == {"scenes/b": "../kept/scenes/b"}
    touch("new.yaml")
    project_file("scenes: [scenes/a.yaml]", "..")
    assert "not in the golden.yaml that lists the other scenes" in refusal(".")


@pytest.mark.parametrize(
    ("places", "expected"),
    [
        (["s"], ["s/goldens/c"]),
        (["s/*.yaml"], ["s/goldens/c"]),
        (["s/a.yaml", "s/b.yaml"], ["s/goldens/c"]),
        (["s/a.yaml"], []),
        (["s/a.yaml", "t/d.yaml"], ["t/goldens/e"]),
        (["t/d.yaml"], []),
        (["s", "t"], ["s/goldens/c", "t/goldens/e"]),
    ],
)
@pytest.mark.parametrize("is_listed", [False, True])
def test_goldens_without_a_scene_are_found_where_all_scenes_are_named(
    places: list[str], expected: list[str], is_listed: bool
) -> None:
    touch("s/a.yaml", "s/b.yaml", "t/d.yaml")
    for name in ("s/goldens/a", "s/goldens/c", "s/goldens/a/golden.ready", "t/goldens/d", "t/goldens/e"):
        touch(f"{name}/golden.json")
    if is_listed:  # the goldens of the project are in the folder of the same name
        project_file("scenes: ['*/*.yaml']\ngoldens: all\n")
        for name in "st":
            Path("all").mkdir(exist_ok=True)
            Path(name, "goldens").rename(f"all/{name}")
        expected = [f"all/{name.replace('goldens/', '')}" for name in expected]
    assert [folder.path.as_posix() for folder in find_project(places).unused] == expected


def test_a_project_file_is_read_once_for_all_scenes_that_a_shell_names(monkeypatch: pytest.MonkeyPatch) -> None:
    """Three hundred scenes took half a minute."""
    names = [f"scenes/{number}.yaml" for number in range(4)]
    touch(*names)
    project_file("scenes: [scenes/*.yaml]\n")
    parse = Mock(wraps=parse_yaml_file)
    monkeypatch.setattr("hsplat_cli.compare.golden.project.parse_yaml_file", parse)
    assert len(goldens_of(*names)) == 4
    assert parse.call_count == 1


def test_goldens_of_a_sidecar_have_a_scene() -> None:
    touch("a.yaml", "film.mp4.json", "goldens/a/golden.json", "goldens/film.mp4/golden.json", "goldens/b/golden.json")
    assert [str(folder.path) for folder in find_project(["."]).unused] == ["goldens/b"]


def test_goldens_in_a_folder_that_several_share_have_scenes_in_all_of_them() -> None:
    touch("s/a.yaml", "t/b.yaml", "kept/a/golden.json", "kept/b/golden.json", "kept/c/golden.json")
    assert [str(folder.path) for folder in find_project(["s", "t"], Path("kept")).unused] == ["kept/c"]


def test_scenes_that_share_their_goldens_are_refused() -> None:
    touch("a.yaml", "a.yml", "x/b.yaml", "y/b.yaml", "z/C.yaml", "z/c.yaml", "u/\u00e9.yaml", "u/e\u0301.yaml")
    assert "rename one of them" in refusal("a.yaml", "a.yml")
    for folder in ("z", "u"):
        assert "two scenes would have the same folder of goldens" in refusal(folder)
    with pytest.raises(InputError, match="list both in a"):
        find_project(["x", "y"], Path("kept"))
    Path("linked").symlink_to("x")
    assert list(goldens_of("x", "linked")) == ["x/b"], "one file is one scene"


@pytest.mark.parametrize(
    ("places", "error"),
    [
        ([], "no golden.yaml in this folder"),
        ([""], "an empty name"),
        (["nowhere.yaml"], "nowhere.yaml: no such scene or folder"),
        (["empty"], "empty: no scenes in this folder"),
        (["n*.yaml"], "no scene matches this pattern"),
        (["a.png"], "a.png: not a scene"),
        (["golden.yml"], "golden.yml, a name that scenes cannot have"),
        (["golden.json"], "golden.json, a name that scenes cannot have"),
        (["broken.yaml"], "broken.yaml: a broken link"),
        (["a\0b"], "no such scene or folder"),
    ],
)
def test_places_without_scenes(places: list[str], error: str) -> None:
    touch("a.png", "golden.yml", "golden.json")
    os.mkdir("empty")
    Path("broken.yaml").symlink_to("gone.yaml")
    assert error in refusal(*places)


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("scenes: []", "scenes: wrong number of items"),
        ("scenes: ['']", "scenes.0: no scene has this name"),
        ("scenes: [nowhere.yaml]", "scenes.0: no scene has this name"),
        ("scenes: [golden.yaml]", "scenes.0: no scene has this name"),
        ("scenes: ['../*.yaml']", "golden.yaml:1:10: scenes.0: outside the project"),
        ("scenes: [/etc/*.yaml]", "scenes.0: outside the project"),
        ('scenes: ["a\\0.yaml"]', "scenes.0: no scene has this name"),
        ("goldens: /etc", "golden.yaml:1:10: goldens: outside the project"),
        ("goldens: kept/../..", "goldens: outside the project"),
        ("frames: all", "golden.yaml:1:9: frames: not a range of frames"),
        ("frames: 1.5", "frames: not a range of frames"),
        ("frames: '::0'", "frames: not a range of frames"),
        ("limit: 450 dB", "limit: out of range"),
        ("{limit: 45 dB, pictures: digests}", "golden.yaml:1:9: limit: digests have no limit but `same bytes`"),
        ("each: {a.yaml: {limit: 45, pictures: digests}}", "each.a.yaml.limit: digests have no limit"),
        ("pictures: none", "pictures"),
        ("each: {b.yaml: {limit: 40}}", "each.b.yaml: no such scene in the project\n"),
        ("each: {a.yaml: {scenes: x}}", "each.a.yaml.scenes: unknown key"),
        ("level: exact", "level: unknown key"),
        ("[]", "not a mapping"),
        ("{", "not valid YAML"),
    ],
)
def test_mistakes_in_a_project_file(text: str, error: str) -> None:
    touch("a.yaml")
    project_file(text)
    assert error in refusal()


def test_all_mistakes_in_a_project_file_are_listed_at_once() -> None:
    touch("a.yaml")
    project_file("scenes: [b.yaml, ../c.yaml, a.yaml]\ngoldens: /x\neach: {d.yaml: {limit: 40}}\n")
    with pytest.raises(SceneError) as caught:
        find_project([])
    assert [problem.path for problem in caught.value.problems] == ["scenes.0", "scenes.1", "goldens", "each.d.yaml"]


def test_a_project_without_scenes() -> None:
    project_file("limit: 45")
    assert "a project without scenes" in refusal(".")
