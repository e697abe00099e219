"""Read a scene file, apply the options of the command line to its tree, and check the result.

Every problem has its location: `scene.yaml:14:13`, or the option that gave the value.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from renderer.errors import InputError, Problem, SceneError
from renderer.scene import yaml_tree
from renderer.scene.input_file import MAX_SCENE_BYTES, read_content, reject_volume_header
from renderer.scene.limits import raise_problems
from renderer.scene.message_text import format_value, join_keys
from renderer.scene.output_formats import output_suffix
from renderer.scene.output_section import only_output
from renderer.scene.scene_reading import parse_scene
from renderer.scene.spec import FilmScene


def load_scene(path: Path, **changes: Any) -> FilmScene:
    """Return the scene in the YAML file `path`.

    changes: the other parameters of `parse_scene_content`, which reads the file's content and raises the same errors.
    """
    return parse_scene_content(read_content(path), path, **changes)


def parse_scene_content(
    content: bytes,
    path: Path,
    *,
    overrides: Sequence[str] = (),
    volume: Path | str | None = None,
    output: Path | str | None = None,
    is_single_frame: bool = False,
) -> FilmScene:
    """Return the scene in the content of the YAML file `path`.

    is_single_frame: whether only one frame of the path is drawn. See `edit_scene_content` for all other parameters.
    Raises InputError if the file is no scene, and SceneError with all problems in it, in the order of the file;
    problems of the command line come last.
    """
    return edit_scene_content(content, path, overrides, volume, output).parse(is_single_frame=is_single_frame)


def edit_scene_content(
    content: bytes,
    path: Path,
    overrides: Sequence[str] = (),
    volume: Path | str | None = None,
    output: Path | str | None = None,
) -> TreeEditor:
    """Return an editor of the scene in the content of the YAML file `path`, with the changes of options.

    Parameters
    ----------
    overrides
        `path.to.key=value`, the value in YAML. Missing mappings are created, list items are counted from 0, and the
        value null removes a key. They are applied in order, before `volume` and `output`.
    volume
        The file, or the URL, that replaces the volume's source.
    output
        The file that replaces the output file.

    Both files, and the output file in the scene, are relative to the current folder. All other files in the scene are
    relative to the scene file.

    Raises InputError if the file is no scene.
    """
    if len(content) > MAX_SCENE_BYTES:
        raise InputError("too large for a scene", where=str(path), expected=f"at most {MAX_SCENE_BYTES} bytes")
    reject_volume_header(content, path)
    tree = yaml_tree.parse_yaml_file(content, path)
    if not isinstance(tree.data, dict):
        got = "an empty file" if tree.data is None else format_value(tree.data)
        expected = "the keys volume, transfer_function, camera and output"
        raise InputError("not a scene", where=str(path), got=got, expected=expected)
    editor = TreeEditor(tree, path)
    editor.apply(overrides, volume, output)
    return editor


_SOURCES = ("file", "raw", "procedural", "array")


# Where a value with a problem comes from: a place in the file, the number of an option, or None if that is unknown.
_Origin = yaml_tree.TextPosition | int | None


@dataclass
class TreeEditor:
    """An editor that changes a tree by command-line options, and knows which option wrote which value.

    Parameters
    ----------
    tree
        A mapping, which is changed.
    path
        The file that it was read from.
    path_prefix
        The path of the scene in the file, for files in which problems are located by keys and not by lines.
    hints
        Hints for problems with values of the file, by the values' paths.
    """

    tree: yaml_tree.YamlTree
    path: Path
    path_prefix: str = ""
    hints: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._problems: list[tuple[_Origin, Problem]] = [*self.tree.problems]
        # For each path, where its value was written: a location in the file, or the number of an option.
        self._writers: dict[str, yaml_tree.SourceLocation | int] = {**self.tree.locations}
        self._options: list[str] = []

    def apply(self, overrides: Sequence[str], volume: Path | str | None, output: Path | str | None) -> None:
        """Change the tree by the values of the options `--set`, `--volume` and `--output`, in this order."""
        for override in overrides:
            self._override(override)
        if volume is not None:
            section = self.tree.data.get("volume")  # only the source is replaced; other keys of the volume remain
            others = section.items() if isinstance(section, dict) else ()
            self.tree.data["volume"] = {key: value for key, value in others if key not in _SOURCES}
            place = volume if isinstance(volume, str) else str(volume.absolute())
            self._set(["volume", "file"], place, self._option(f"--volume {volume}"))
        if output is not None:
            self.tree.data["output"] = only_output(self.tree.data.get("output"), output_suffix(output))
            self._set(["output", "file"], str(output), self._option(f"--output {output}"))

    @property
    def overridden_paths(self) -> list[str]:
        """Return the dotted paths of the keys that options have written."""
        return [path for path, writer in self._writers.items() if isinstance(writer, int)]

    def parse(self, *, is_single_frame: bool = False) -> FilmScene:
        """Return the scene; its files are relative to the folder of the tree's file.

        Raises SceneError with all problems, in the order of the file; problems of the command line come last.
        """
        problems: Sequence[Problem] = ()
        try:
            scene = parse_scene(self.tree.data, base=self.path.parent.absolute(), is_single_frame=is_single_frame)
        except SceneError as error:
            problems = error.problems
        raise_problems(self.located_problems(problems))
        return scene

    def located_problems(self, problems: Iterable[Problem]) -> list[Problem]:
        """Return `problems` and those of text and options, with their locations, in the order of `parse`."""
        found = [*self._problems, *map(self._with_origin, problems)]
        return [self._located(*item) for item in sorted(found, key=_sort_key)]

    def _option(self, text: str) -> int:
        """Keep the text of the next option, and return the option's number."""
        self._options.append(text)
        return len(self._options) - 1

    def _override(self, text: str) -> None:
        """Apply the option `--set path.to.key=value`. text: `path.to.key=value`."""
        option = self._option(f"--set {text}")
        name, equals, value_text = text.partition("=")
        parts = name.strip().split(".")
        if not equals or not all(parts):
            self._problems.append((option, Problem("", "not an override", expected="--set path.to.key=value")))
            return
        if value_text.strip().startswith("#"):  # the value is a color, which YAML would take for a comment
            self._set(parts, value_text.strip(), option)
            return
        try:
            value = yaml_tree.parse_yaml(value_text)
        except yaml_tree.NotYamlError as error:
            self._problems.append((option, Problem("", error.what, hint=error.hint)))
            return
        for _, problem in value.problems:
            path = ".".join(filter(None, (name.strip(), problem.path)))
            self._problems.append((option, replace(problem, path=path)))
        if value_text.strip():
            self._set(parts, value.data, option)
        else:
            hint = f"to take the key away, give {name.strip()}=null"
            problem = Problem(name.strip(), "no value", expected="--set path.to.key=value", hint=hint)
            self._problems.append((option, problem))

    def _set(self, parts: Sequence[str], value: Any, option: int) -> None:
        """Set `value` at the path `parts`, written by `option`; None removes the key."""
        parent, path = self.tree.data, ""
        for number, part in enumerate(parts, start=1):
            key = self._key(parent, part, path, option)
            if key is None:
                return
            path = join_keys(path, key)
            is_last = number == len(parts)
            if is_last or (isinstance(parent, dict) and parent.get(key) is None):
                self._remember(path, option)
                parent[key] = value if is_last else {}
            if not is_last:
                parent = parent[key]
            elif value is None and isinstance(parent, dict):
                del parent[key]

    def _key(self, parent: Any, part: str, path: str, option: int) -> Any:
        """Return the key or the list index that `part` names in `parent`; a new key is allowed, a new index is not."""
        if isinstance(parent, dict):
            return next((key for key in parent if join_keys("", key) == part), part)
        if isinstance(parent, list):
            if re.fullmatch("[0-9]{1,9}", part) and int(part) < len(parent):
                return int(part)
            expected = f"a number from 0 to {len(parent) - 1}" if parent else None
            problem = Problem(path, "no such item in this list", got=part, expected=expected)
        else:
            problem = Problem(path, "neither a mapping nor a list", got=format_value(parent))
        self._problems.append((option, problem))
        return None

    def _remember(self, path: str, option: int) -> None:
        """Record that `option` wrote `path` and all below it."""
        for known in [known for known in self._writers if known.startswith(f"{path}.")]:
            del self._writers[known]
        self._writers[path] = option

    def _with_origin(self, problem: Problem) -> tuple[_Origin, Problem]:
        """Return the problem with the origin of its path or, if that is unknown, of the nearest part around it."""
        path = problem.path
        while path and path not in self._writers:
            path = path.rpartition(".")[0]
        if not path and (problem.path or not self.tree.locations):
            keys = ".".join(filter(None, (self.path_prefix, problem.path)))
            return None, replace(problem, path=keys, hint=self.hints.get(problem.path, problem.hint))
        writer = self._writers[path]
        if isinstance(writer, int):
            return writer, problem
        return writer.key if problem.at_key or path != problem.path else writer.value, problem

    def _located(self, origin: _Origin, problem: Problem) -> Problem:
        """Return the problem with its location and, if the location is in the file, the text of the line there."""
        if isinstance(origin, int):
            return replace(problem, location=self._options[origin])
        what = yaml_tree.with_excerpt(problem.what, self.tree.lines, origin)
        return replace(problem, location=yaml_tree.format_location(self.path, origin), what=what)


def _sort_key(item: tuple[_Origin, Problem]) -> tuple[int, int, int]:
    """Return the key that sorts problems by line and column, and puts problems of options last."""
    origin, _ = item
    if isinstance(origin, int):
        return 1, origin, 0
    return (0, origin.line, origin.column) if origin else (0, 0, 0)
