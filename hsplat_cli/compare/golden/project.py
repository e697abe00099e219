"""Read a project of goldens: the scenes, the folder of each one's goldens, their frames and limits.

A project is a file `golden.yaml`, all of whose keys may be left out:

    scenes: [scenes/*.yaml]
    goldens: goldens
    frames: ::10
    limit: same bytes
    pictures: files
    each:
      scenes/engine.yaml: {limit: 45 dB, frames: 0:10}

Without the file, scenes, folders of scenes and patterns on the command line are the project; the goldens of
`scenes/engine.yaml` are then in `scenes/goldens/engine`.
"""

from __future__ import annotations

import glob
import os
import shlex
import unicodedata
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from pathlib import Path
from typing import Annotated, Any, Literal

from hsplat_cli.compare.golden.golden_folder import GoldenFolder
from hsplat_cli.compare.golden.record import GOLDEN_RECORD_FILE, SLICE_FIELD
from hsplat_cli.compare.limit import HINT_FOR_DIGESTS, LIMIT_FIELD, LIMIT_OF_DIGESTS, SAME_BYTES, Limit
from hsplat_cli.compare.picture_file import file_content
from renderer.errors import InputError, Problem
from renderer.film import folder_files
from renderer.scene import (
    MAX_SCENE_BYTES,
    TreeEditor,
    did_you_mean,
    join_keys,
    missing_file_error,
    parse_yaml_file,
    raise_problems,
    schema,
)

PROJECT_FILE = "golden.yaml"
_SCENE_SUFFIXES = (".yaml", ".yml")
# The suffix of a film's sidecar, which stands for its scene where it is named itself.
_SIDECAR_SUFFIX = ".json"
# The folder of all goldens, beside the scenes or the file of the project.
_GOLDENS = "goldens"
# The error of a place that is not there.
NO_SCENE = "no such scene or folder"
# The paths that golden.yaml may name, for messages.
_BELOW = f"a path below the folder of {PROJECT_FILE}"

# Whether goldens are kept as picture files, or as digests in golden.json alone.
Pictures = Literal["files", "digests"]
_PICTURES_FIELD: schema.FieldType[Pictures] = schema.choice_field("files", "digests")


def _check_limit(node: schema.TreeNode, given: dict[str, Any]) -> None:
    if given.get("pictures") == "digests" and isinstance(given.get("limit"), Limit) and given["limit"] != SAME_BYTES:
        node.child("limit").reject(LIMIT_OF_DIGESTS, got=str(given["limit"]), hint=HINT_FOR_DIGESTS)


@dataclass(frozen=True)
class SceneRules:
    """The rules for the goldens of a scene; None for a rule that is not given.

    frames: a Python slice of the frames that should have goldens. limit: the largest difference that passes.
    pictures: how goldens are kept.
    """

    frames: Annotated[str | None, SLICE_FIELD] = None
    limit: Annotated[Limit | None, LIMIT_FIELD] = None
    pictures: Annotated[Pictures | None, _PICTURES_FIELD] = None

    def over(self, other: SceneRules) -> SceneRules:
        """Return these rules, with those of `other` where one is not given."""
        return SceneRules(self.frames or other.frames, self.limit or other.limit, self.pictures or other.pictures)


@dataclass(frozen=True)
class GoldenScene:
    """A scene of a project.

    name: the path of the scene in the project, without a suffix. file: the scene's file. former: where there is no
    golden.json in the folder, the folder of goldens that may be this scene's, because it was renamed, or because a
    golden.yaml was added or removed.
    """

    name: str
    file: Path
    folder: GoldenFolder
    rules: SceneRules
    former: GoldenFolder | None = None

    @property
    def move_command(self) -> str:
        """Return the command that moves the former goldens to their folder now; an empty text without any."""
        if self.former is None:
            return ""
        path = self.folder.path
        make = [] if path.parent.is_dir() else [shlex.join(["mkdir", "-p", str(path.parent)])]
        return " && ".join([*make, shlex.join(["git", "mv", str(self.former.path), str(path)])])


@dataclass(frozen=True)
class GoldenProject:
    """A project of goldens.

    scenes: at least one, in the order of names. unused: the folders of goldens that belong to no scene. They are looked
    for where all scenes of a golden.yaml, or of a folder, are named.
    """

    scenes: Sequence[GoldenScene]
    unused: Sequence[GoldenFolder] = ()


@dataclass(frozen=True)
class _Place:
    """The scenes that a golden.yaml, a folder or a file names.

    root: the folder to which the names of scenes are relative. goldens: the folder of their goldens, and of those of
    others. whole: the files of all scenes that have goldens there, also of those that are not named.
    """

    root: Path
    scenes: Sequence[GoldenScene]
    goldens: Path
    whole: Sequence[Path]

    @cached_property
    def by_file(self) -> dict[Path, GoldenScene]:
        """Return the scenes by their files, whose links are followed."""
        return {scene.file.resolve(): scene for scene in self.scenes}


@dataclass(frozen=True)
class _ProjectFile(SceneRules):
    """The content of golden.yaml: the rules for all scenes, and those for each."""

    scenes: Annotated[
        tuple[str, ...] | None, schema.sequence_field(schema.TEXT_FIELD, "a list of scenes and patterns")
    ] = None
    goldens: str = _GOLDENS
    each: Annotated[
        Mapping[str, SceneRules],
        schema.mapping_field(
            schema.dataclass_field(SceneRules, _check_limit), "a mapping of scenes to their rules", "a scene"
        ),
    ] = field(default_factory=dict)


def parse_rules(frames: str | None, limit: str | None, pictures: Pictures | None = None) -> SceneRules:
    """Return the rules that options give. Raises SceneError for a wrong limit, or a wrong range of frames."""
    problems: list[Problem] = []
    picked = None if frames is None else schema.read_option(SLICE_FIELD, frames, "--frames", problems)
    found = None if limit is None else schema.read_option(LIMIT_FIELD, limit, f"--limit {limit}", problems)
    raise_problems(problems)
    return SceneRules(picked, found, pictures)


def find_project(places: Sequence[str], goldens: Path | None = None, rules: SceneRules | None = None) -> GoldenProject:
    """Find the scenes that a command line names, and their goldens.

    places: scenes, sidecars of films, folders of scenes or of a golden.yaml, patterns, or a golden.yaml; without any,
    the golden.yaml of this folder. A scene that a golden.yaml above it lists keeps its rules and goldens where it is
    named alone. goldens: the folder of all goldens, if the command line names one. rules: those of the command line,
    which come before those of files.
    Raises InputError where there is no scene, and SceneError for mistakes in golden.yaml.
    """
    finder, found = _Finder(goldens, rules or SceneRules()), dict[Path, GoldenScene]()
    named = [path for place in places or [_own_project()] for path in _expanded(place)]
    read = [finder.find(path) for path in named]
    for place in read:
        for scene in place.scenes:
            found.setdefault(scene.file.resolve(), scene)
    is_one_file = len(named) == 1 and named[0].is_file() and named[0].name != PROJECT_FILE
    unused = [] if is_one_file else [*_unused(read, found)]
    scenes = _named([Path(os.path.abspath(place.root)) for place in read], [*found.values()])
    _require_distinct(scenes)
    return GoldenProject([*_with_former(scenes, unused, looks_elsewhere=goldens is None)], unused)


def _own_project() -> str:
    """Return the file of the project in this folder. Raises InputError without one."""
    if not os.path.lexists(PROJECT_FILE):
        raise InputError(
            f"no {PROJECT_FILE} in this folder",
            where=str(Path.cwd()),
            expected=f"a scene, a folder of scenes, a pattern such as scenes/*.yaml, or a {PROJECT_FILE} here",
        )
    return PROJECT_FILE


def _named(roots: Sequence[Path], scenes: Sequence[GoldenScene]) -> list[GoldenScene]:
    """Return scenes in the order of their names, which are relative to the folder that all roots have in common."""
    if len(set(roots)) > 1:
        root = Path(os.path.commonpath(roots))
        scenes = [replace(scene, name=_name(scene.file, root)) for scene in scenes]
    return sorted(scenes, key=lambda scene: scene.name)


def _require_distinct(scenes: Sequence[GoldenScene]) -> None:
    """Raise InputError if two scenes would share their goldens.

    Some file systems ignore the case of names, or how their accents are coded.
    """
    owners = dict[str, GoldenScene]()
    for scene in scenes:
        place = unicodedata.normalize("NFC", str(scene.folder.path.resolve())).casefold()
        other = owners.setdefault(place, scene)
        if other is not scene:
            is_beside = scene.file.parent.resolve() == other.file.parent.resolve()
            raise InputError(
                "two scenes would have the same folder of goldens",
                where=str(scene.file),
                got=f"{scene.folder.path}, as of {other.file}",
                hint="rename one of them" if is_beside else f"list both in a {PROJECT_FILE} above them",
            )


def _with_former(
    scenes: Sequence[GoldenScene], unused: Sequence[GoldenFolder], *, looks_elsewhere: bool
) -> Iterator[GoldenScene]:
    """Yield the scenes, each without goldens with the goldens that may be its own.

    They are in the place of a project with another golden.yaml, or without one; or no scene has them, and one scene has
    no goldens: it was renamed. looks_elsewhere: whether the first is possible, as no option names the place.
    """
    without = {scene.file for scene in scenes if not _has_goldens(scene.folder.path)}
    renamed = unused[0] if len(unused) == len(without) == 1 else None
    for scene in scenes:
        former = (_elsewhere(scene.file) if looks_elsewhere else None) or renamed
        yield replace(scene, former=former) if scene.file in without else scene


def _elsewhere(file: Path) -> GoldenFolder | None:
    """Return the goldens of a scene in the place that a golden.yaml in a folder above, or none, gives them."""
    file = Path(os.path.abspath(file))
    places = [root / _GOLDENS / _name(file, root) for root in file.parents]
    return next((GoldenFolder(Path(os.path.relpath(each))) for each in places if _has_goldens(each)), None)


def _has_goldens(folder: Path) -> bool:
    return os.path.lexists(folder / GOLDEN_RECORD_FILE)


def _expanded(place: str) -> list[Path]:
    """Return the files and folders that a scene, a folder or a pattern names. Raises InputError if there are none."""
    if not place:
        raise InputError("an empty name", expected="a scene, a folder, or a pattern such as scenes/*.yaml")
    if Path(place).exists() or not glob.has_magic(place):
        return [Path(place)]
    found = [Path(each) for each in sorted(glob.glob(place, recursive=True)) if _is_scene_name(each)]
    if not found:
        raise InputError("no scene matches this pattern", where=place, hint=f"it is relative to {Path.cwd()}")
    return found


def _scenes_in(folder: Path) -> list[Path]:
    """Return the files of the scenes in a folder."""
    return sorted(file for file in folder_files(folder) if _is_scene_name(file.name))


def _is_scene_name(name: str) -> bool:
    """Return whether a file in a folder is a scene by its name; golden.yaml, golden.yml and hidden files are not."""
    path = Path(name)
    return path.suffix.lower() in _SCENE_SUFFIXES and not path.name.startswith((".", "golden."))


class _Finder:
    """Finds scenes by the options of a command line, which are as in `find_project`."""

    def __init__(self, goldens: Path | None, rules: SceneRules) -> None:
        self._goldens, self._rules = goldens, rules
        # A shell names each scene of a folder: what they have in common is read once.
        self._around = cache(self._read_around)
        self._scenes_in = cache(_scenes_in)

    def find(self, path: Path) -> _Place:
        """Return the scenes at a path: of a golden.yaml, of a folder, or of one scene."""
        if path.is_dir() and os.path.lexists(path / PROJECT_FILE):
            path /= PROJECT_FILE
        if path.name == PROJECT_FILE:
            return self._read(path)
        if not path.is_dir():
            _require_scene_name(path)
            return self._scenes_of([path], path.parent)
        files = self._scenes_in(path)
        if not files:
            expected, hint = f"*.yaml, or a {PROJECT_FILE}", f"`--goldens {path}` makes it the folder of all goldens"
            raise InputError("no scenes in this folder", where=str(path), expected=expected, hint=hint)
        return self._scenes_of(files, path)

    def _scenes_of(self, files: Sequence[Path], folder: Path) -> _Place:
        """Return some scenes in a folder: those that the golden.yaml above them lists are its scenes."""
        around = self._around(folder)
        if around is None or not any(file.resolve() in around.by_file for file in files):
            place = folder / _GOLDENS if self._goldens is None else self._goldens
            scenes = [_scene(file, folder, place, self._rules) for file in files]
            return _Place(folder, scenes, place, self._scenes_in(folder))
        others = [file for file in files if file.resolve() not in around.by_file]
        if others:
            raise InputError(
                f"not in the {PROJECT_FILE} that lists the other scenes",
                where=str(others[0]),
                expected=f"scenes that {around.root / PROJECT_FILE} lists",
            )
        scenes = [replace(around.by_file[file.resolve()], file=file) for file in files]
        place = scenes[0].folder.path.parent
        whole = [each.file for each in around.scenes if place in each.folder.path.parents]
        return _Place(around.root, scenes, place, whole)

    def _read_around(self, folder: Path) -> _Place | None:
        """Return the scenes of the nearest golden.yaml in a folder or above it; None without one."""
        here = Path(os.path.abspath(folder))
        for each in (here, *here.parents):
            if (each / PROJECT_FILE).is_file():
                return self._read(Path(os.path.relpath(each)) / PROJECT_FILE)
        return None

    def _read(self, path: Path) -> _Place:
        """Read a golden.yaml. Raises InputError, and SceneError with all mistakes in it."""
        tree = parse_yaml_file(file_content(path, MAX_SCENE_BYTES, f"a {PROJECT_FILE}"), path)
        problems: list[Problem] = []
        node = schema.TreeNode({} if tree.data is None else tree.data, "", problems)
        read: Any = schema.dataclass_field(_ProjectFile, _check_limit).read(node)
        editor = TreeEditor(tree, path)
        raise_problems(editor.located_problems(problems))
        root = path.parent
        files = sorted(set(_listed_scenes(root, read.scenes, problems)))
        own_rules = {(root / name).resolve(): name for name in read.each}
        problems += _unknown_scenes(own_rules, files, root)
        if not _is_below(read.goldens):
            problems.append(Problem("goldens", "outside the project", read.goldens, _BELOW))
        raise_problems(editor.located_problems(problems))
        if not files:
            raise InputError("a project without scenes", where=str(path), expected="scenes: [scenes/*.yaml]")
        folder = root / read.goldens if self._goldens is None else self._goldens
        scenes = []
        for file in files:
            name = own_rules.get(file.resolve())
            own = read.each[name] if name is not None else SceneRules()
            scenes.append(_scene(file, root, folder, self._rules.over(own.over(read))))
        return _Place(root, scenes, folder, files)


def _scene(file: Path, root: Path, goldens: Path, rules: SceneRules) -> GoldenScene:
    name = _name(file, root)
    return GoldenScene(name, file, GoldenFolder(goldens / name.replace("../", "")), rules)


def _require_scene_name(path: Path) -> None:
    if not path.exists():
        raise missing_file_error(path, NO_SCENE)
    if path.suffix.lower() in (*_SCENE_SUFFIXES, _SIDECAR_SUFFIX) and not path.name.startswith("golden."):
        return
    got = f"a {path.suffix} file" if path.suffix else "no suffix"
    if path.name.startswith("golden."):
        got = f"{path.name}, a name that scenes cannot have"
    raise InputError("not a scene", where=str(path), got=got, expected=f"a .yaml file, a folder, or {PROJECT_FILE}")


def _name(file: Path, root: Path) -> str:
    """Return the name of a scene: its path from a folder, without a suffix."""
    return Path(os.path.relpath(file, root)).with_suffix("").as_posix()


def _is_below(entry: str) -> bool:
    return not Path(entry).is_absolute() and ".." not in Path(entry).parts


def _listed_scenes(root: Path, listed: Sequence[str] | None, problems: list[Problem]) -> Iterator[Path]:
    """Yield the scenes of a project's file: those that it lists, or all in its folder."""
    if listed is None:
        yield from _scenes_in(root)
        return
    for number, entry in enumerate(listed):
        key = join_keys("scenes", str(number))
        if not _is_below(entry):
            problems.append(Problem(key, "outside the project", entry, _BELOW))
            continue
        found = [root / each for each in glob.glob(entry, root_dir=root, recursive=True)]
        files = [file for file in found if _is_scene_name(file.name) and file.is_file()]
        if not files:
            problems.append(Problem(key, "no scene has this name", entry, "a scene, or a pattern"))
        yield from files


def _unknown_scenes(rules: Mapping[Path, str], files: Sequence[Path], root: Path) -> Iterator[Problem]:
    """Yield a problem for each scene that has rules of its own, but is not in the project."""
    known = {file.resolve() for file in files}
    names = [Path(os.path.relpath(file, root)).as_posix() for file in files]
    for place, name in rules.items():
        if place not in known:
            hint = did_you_mean(name, names)
            yield Problem(join_keys("each", name), "no such scene in the project", hint=hint, at_key=True)


def _unused(places: Sequence[_Place], found: Mapping[Path, GoldenScene]) -> Iterator[GoldenFolder]:
    """Yield the folders with a golden.json that belong to no scene, below goldens of which all scenes are named.

    Goldens of a sidecar, which is a scene only where it is named, are left out. found: the scenes that are named, by
    their files.
    """
    used = {scene.folder.path.resolve() for scene in found.values()}
    distinct = {(place.root, place.goldens): place for place in places}
    partial = {place.goldens for place in distinct.values() if not all(file.resolve() in found for file in place.whole)}
    for goldens in dict.fromkeys(place.goldens for place in distinct.values()):
        if goldens in partial or not goldens.is_dir():
            continue
        roots = [place.root for place in distinct.values() if place.goldens == goldens]
        for record in sorted(goldens.rglob(GOLDEN_RECORD_FILE)):
            folder = record.parent
            sidecars = [root / f"{folder.relative_to(goldens)}{_SIDECAR_SUFFIX}" for root in roots]
            is_used = folder.resolve() in used or any(sidecar.exists() for sidecar in sidecars)
            if not is_used and not folder.name.startswith("golden."):
                yield GoldenFolder(folder)


def unused_error(unused: GoldenFolder, arguments: Sequence[str]) -> InputError:
    """Return the error of goldens without a scene. arguments: the words of the command line that name the project."""
    by_git = shlex.join(["git", "rm", "-r", str(unused.path)])
    update = shlex.join(["hsplat", "golden", *arguments, "--update", "--prune"])
    renamed = shlex.join(["git", "mv", str(unused.path), str(unused.path.with_name("NEW_NAME"))])
    hint = f"restore the scene; if it was renamed, `{renamed}`; or remove the folder: `{by_git}`, or `{update}`"
    return InputError("no scene has these goldens", hint=hint)
