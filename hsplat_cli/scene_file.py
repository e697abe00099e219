"""A scene file, with what the command line changes in it, to a checked Scene.

Every complaint names its place: `scene.yaml:14:13`, or the option that brought the value in.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from hsplat_cli.yaml_tree import LINE_BREAK, Mark, NotYamlError, Tree, read_tree
from renderer.errors import InputError, Problem, SceneError, nearest
from renderer.scene import Scene
from renderer.scene_schema import parse_scene
from renderer.schema import join, show

MAX_BYTES = 2**20

_SOURCES = ("file", "raw", "procedural")


def load_scene(
    path: Path, *, overrides: Sequence[str] = (), volume: Path | None = None, output: Path | None = None
) -> Scene:
    """The scene in the YAML file `path`.

    Parameters
    ----------
    overrides: `path.to.key=value`, value being YAML; missing mappings are made, list items are named by their number
        from 0, and the value null takes a key away. They apply in their order, before the two below.
    volume: takes the place of the volume's source, and output that of the output file; both are relative to the
        current folder. Volume files in the scene are relative to the scene file, and its output file to the current
        folder.

    Raises InputError where the file cannot be read, and SceneError with all the complaints about what is in it, in
    their order in the file, those about the command line last.
    """
    text = _read_text(path)
    lines = LINE_BREAK.split(text)
    try:
        tree = read_tree(text)
    except NotYamlError as error:
        where = str(path) if error.mark is None else f"{path}:{error.mark.line}:{error.mark.column}"
        raise InputError(error.what + _excerpt(lines, error.mark), where=where, hint=error.hint) from error
    if not isinstance(tree.data, dict):
        got = "an empty file" if tree.data is None else show(tree.data)
        expected = "the keys volume, transfer_function, camera and output"
        raise InputError("not a scene", where=str(path), got=got, expected=expected)
    editor = _Editor(tree)
    for override in overrides:
        editor.override(override)
    if volume is not None:
        editor.replace_volume(volume)
    if output is not None:
        editor.set(["output", "file"], str(output), editor.option(f"--output {output}"))
    problems = editor.problems
    try:
        scene = parse_scene(tree.data, base=path.parent.absolute())
    except SceneError as error:
        problems = problems + [editor.located(problem) for problem in error.problems]
    if problems:
        raise SceneError([item.complaint(path, lines) for item in sorted(problems, key=lambda item: item.order)])
    return scene


def _read_text(path: Path) -> str:
    try:
        with path.open("rb") as file:
            content = file.read(MAX_BYTES + 1)
    except FileNotFoundError as error:
        raise InputError("no such file", where=str(path), hint=_nearest_file(path)) from error
    except IsADirectoryError as error:
        raise InputError("a folder", where=str(path), expected="a scene file") from error
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else None
        raise InputError(f"cannot be read: {reason or error}", where=str(path)) from error
    if len(content) > MAX_BYTES:
        raise InputError("too large for a scene", where=str(path), expected=f"at most {MAX_BYTES} bytes")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise InputError(
            "not a text file in UTF-8",
            where=f"{path}:{line}",
            got=f"the byte 0x{content[error.start]:02x}",
            hint="a volume is rendered with `hsplat render SCENE --volume FILE`" if b"\0" in content else None,
        ) from error


def _nearest_file(path: Path) -> str | None:
    try:
        names = sorted(entry.name for entry in path.parent.iterdir())
    except OSError:
        return None
    close = nearest(path.name, names)
    return f"did you mean {path.with_name(close)}?" if close else None


@dataclass(frozen=True)
class _Option:
    """An option of the command line as it was written, and its number among them."""

    number: int
    text: str


@dataclass(frozen=True)
class _Located:
    """A problem and its place: a mark in the file, or an option, or neither."""

    problem: Problem
    mark: Mark | None = None
    option: _Option | None = None

    @property
    def order(self) -> tuple[int, int, int]:
        """Sorts by line and column, options after that."""
        if self.option is not None:
            return 1, self.option.number, 0
        return (0, self.mark.line, self.mark.column) if self.mark else (0, 0, 0)

    def complaint(self, path: Path, lines: Sequence[str]) -> Problem:
        """The problem with its place and, if that is in the file, the line that it is about."""
        if self.option is not None:
            return replace(self.problem, place=self.option.text)
        place = f"{path}:{self.mark.line}:{self.mark.column}" if self.mark else str(path)
        return replace(self.problem, place=place, what=self.problem.what + _excerpt(lines, self.mark))


def _excerpt(lines: Sequence[str], mark: Mark | None) -> str:
    """A line of the file with a caret below the column, to be appended to a message."""
    if mark is None:
        return ""
    line = lines[mark.line - 1].replace("\t", " ").rstrip()
    if not line.isprintable() or not 0 < len(line) <= _MAX_LINE:
        return ""
    indent = len(line) - len(line.lstrip())
    return f"\n    | {line[indent:]}\n    | {' ' * (mark.column - 1 - indent)}^"


_MAX_LINE = 120


class _Editor:
    """Changes a tree as the options of the command line say, and remembers which of them wrote what."""

    def __init__(self, tree: Tree) -> None:
        self.tree = tree
        self.problems = [_Located(problem, mark) for mark, problem in tree.problems]
        self._options: dict[str, _Option] = {}
        self._num_options = 0

    def option(self, text: str) -> _Option:
        """The next option."""
        self._num_options += 1
        return _Option(self._num_options, text)

    def override(self, text: str) -> None:
        """Apply `path.to.key=value`."""
        option = self.option(f"--set {text}")
        name, equals, value_text = text.partition("=")
        parts = name.strip().split(".")
        if not equals or not all(parts):
            self._complain(option, Problem("", "not an override", expected="--set path.to.key=value"))
            return
        if value_text.strip().startswith("#"):  # a color and not a comment
            self.set(parts, value_text.strip(), option)
            return
        try:
            value = read_tree(value_text)
        except NotYamlError as error:
            self._complain(option, Problem("", error.what, hint=error.hint))
            return
        for _, problem in value.problems:
            self._complain(option, replace(problem, path=".".join(filter(None, (name.strip(), problem.path)))))
        if not value_text.strip():
            hint = f"to take the key away, give {name.strip()}=null"
            self._complain(option, Problem(name.strip(), "no value", expected="--set path.to.key=value", hint=hint))
            return
        self.set(parts, value.data, option)

    def replace_volume(self, volume: Path) -> None:
        """Let the volume come from a file, with the other keys of the section as they are."""
        option = self.option(f"--volume {volume}")
        section = self.tree.data.get("volume")
        rest = (
            {key: value for key, value in section.items() if key not in _SOURCES} if isinstance(section, dict) else {}
        )
        self.tree.data["volume"] = rest
        self.set(["volume", "file"], str(volume.absolute()), option)

    def set(self, parts: Sequence[str], value: Any, option: _Option) -> None:
        """Put `value` at the path `parts` and remember that `option` did it; None takes the key away."""
        parent, path = self.tree.data, ""
        for part in parts[:-1]:
            key = self._key(parent, part, path, option)
            if key is None:
                return
            path = join(path, key)
            if isinstance(parent, dict) and parent.get(key) is None:
                parent[key] = {}
                self._remember(path, option)
            parent = parent[key]
        key = self._key(parent, parts[-1], path, option)
        if key is None:
            return
        self._remember(join(path, key), option)
        if value is None and isinstance(parent, dict):
            parent.pop(key, None)
        else:
            parent[key] = value

    def _key(self, parent: Any, part: str, path: str, option: _Option) -> Any:
        """What `part` names in `parent`: a key, which need not be there, or an index, which must."""
        if isinstance(parent, dict):
            return next((key for key in parent if join("", key) == part), part)
        if isinstance(parent, list):
            if re.fullmatch("[0-9]{1,9}", part) and int(part) < len(parent):
                return int(part)
            expected = f"a number from 0 to {len(parent) - 1}" if parent else None
            self._complain(option, Problem(path, "no such item in this list", got=part, expected=expected))
        else:
            self._complain(option, Problem(path, "neither a mapping nor a list", got=show(parent)))
        return None

    def _remember(self, path: str, option: _Option) -> None:
        """From now on, `path` and all below it come from `option`."""
        for known in [known for known in (*self.tree.places, *self._options) if known.startswith(f"{path}.")]:
            self.tree.places.pop(known, None)
            self._options.pop(known, None)
        self._options[path] = option

    def _complain(self, option: _Option, problem: Problem) -> None:
        self.problems.append(_Located(problem, option=option))

    def located(self, problem: Problem) -> _Located:
        """The problem at the place of its path or, if that is nowhere, of the nearest part around it."""
        path, is_around = problem.path, False
        while path and path not in self._options and path not in self.tree.places:
            path, is_around = path.rpartition(".")[0], True
        if path in self._options:
            return _Located(problem, option=self._options[path])
        if not path:
            return _Located(problem)
        place = self.tree.places[path]
        return _Located(problem, place.key if problem.at_key or is_around else place.value)
