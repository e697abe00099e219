"""The rooms: imports go one way and through doors, files can be read at one sitting.

What else holds for the code (silence, no clock, nothing dangerous, docstrings) is checked by ruff; see pyproject.toml.
"""

from __future__ import annotations

import ast
import contextlib
import importlib
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from renderer.kernels import source_files

ROOT = Path(__file__).resolve().parents[2]
MAX_FILE_LINES = 500
# Files that are made from others, and may be longer: the records of kernels.
MADE = {ROOT / "renderer" / "kernels" / "records.py"}
# The line of a door below which its names are for tests: steps of its work, and constants of it.
FOR_TESTS = "# For tests alone: steps and constants that no other room uses.\n"

# The rooms of each package in their order: each may use those before it. Modules beside the rooms come after the first
# of them in renderer/, and after all of them in hsplat_cli/. The Python API uses all rooms; none uses it.
ORDER = {
    "renderer": [
        "system", "kernels", "cache", "volume", "looks", "scene", "stores", "readers", "statistics", "transfer",
        "suggest", "pyramid", "lighting", "splats", "bricks", "view", "modes", "layers", "draw", "film", "annotation",
        "frame", "truth", "accuracy", "resolve", "record", "job",
    ],
    "hsplat_cli": [
        "terminal", "scenes", "executors", "reports", "compare", "measure", "turntable", "preview", "commands",
    ],
}  # fmt: skip
API = "renderer.api"
ROOMS = [f"{package}.{room}" for package, rooms in ORDER.items() for room in rooms]


def _module(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


SOURCES = {_module(path): path for package in ORDER for path in sorted((ROOT / package).rglob("*.py"))}


def _room(module: str) -> str:
    """`renderer.draw` of `renderer.draw.splats.splat_rasterizer`; the package of a module that is in no room.

    Of the door of `renderer` it is the API, whose names it has.
    """
    if module == "renderer" or module.startswith(API):
        return API
    room = ".".join(module.split(".")[:2])
    return room if room in ROOMS else module.partition(".")[0]


@cache
def _imports(path: Path) -> frozenset[str]:
    return frozenset(module for module, _ in _imported_names(path))


@cache
def _imported_names(path: Path) -> frozenset[tuple[str, str]]:
    """Return all that a file imports: the full name of a module, and a name in it, which may be empty."""
    return frozenset(_names_imported_by(ast.parse(path.read_text("utf-8")), path))


def _names_imported_by(tree: ast.AST, path: Path) -> Iterator[tuple[str, str]]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((alias.name, "") for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0 and node.module, f"{path}: a relative import"
            for alias in node.names:
                child = f"{node.module}.{alias.name}"
                is_module = child in SOURCES and alias.name not in _offers(node.module)
                yield (child, "") if is_module else (node.module, alias.name)


def _programs(path: Path) -> Iterator[ast.AST]:
    """Yield the program of a test file, and those that it has as texts, which its child processes run."""
    whole = ast.parse(path.read_text("utf-8"))
    yield whole
    for node in ast.walk(whole):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and "import " in node.value:
            with contextlib.suppress(SyntaxError):
                yield ast.parse(node.value)


@cache
def _names_imported_by_programs(path: Path) -> frozenset[tuple[str, str]]:
    """Return all that a test file and its programs import."""
    return frozenset(each for tree in _programs(path) for each in _names_imported_by(tree, path))


@cache
def _offers(module: str) -> dict[str, bool]:
    """Return the names at the door of a room, and of each whether it is there for tests alone."""
    stub = ROOT / module.replace(".", "/") / "__init__.pyi"
    if module not in (*ROOMS, "renderer") or not stub.exists():
        return {}
    text = stub.read_text("utf-8")
    num_lines = text.partition(FOR_TESTS)[0].count("\n")
    imports = [node for node in ast.parse(text).body if isinstance(node, ast.ImportFrom)]
    return {alias.name: node.lineno > num_lines for node in imports for alias in node.names}


def _is_door(module: str) -> bool:
    """A room, a module that its room offers, one beside the rooms, or one that another program finds by its name."""
    is_known = module in (
        *ROOMS,
        "renderer",
        "renderer.scene.schema",
        "renderer.record.field_types",
        "hsplat_cli.compare.pytest_plugin",
    )
    return is_known or _room(module) in ORDER


def test_every_folder_is_a_room() -> None:
    for package, rooms in ORDER.items():
        assert {path.parent.name for path in (ROOT / package).glob("*/__init__.py")} == set(rooms)


@pytest.mark.parametrize("room", ["renderer", *ROOMS, API, "hsplat_cli"])
def test_imports_go_one_way_and_through_doors(room: str) -> None:
    order = [ROOMS[0], "renderer", *ROOMS[1:], "hsplat_cli", API]
    for module, path in SOURCES.items():
        others = [name for name in _imports(path) if name.partition(".")[0] in ORDER and _room(name) != _room(module)]
        for other in others if _room(module) == room else ():
            assert order.index(_room(other)) < order.index(room), f"{module} imports {other}, from a room above it"
            assert _is_door(other), f"{module} imports {other}, which is behind the door of {_room(other)}"


@pytest.mark.parametrize("room", ["renderer", *ROOMS[:-1]])  # commands are found by their files
def test_doors_open(room: str) -> None:
    """A docstring that says what comes in and goes out, and what each file does; public names that are there."""
    door = importlib.import_module(room)
    summary, _, files = (door.__doc__ or "").partition("\n- ")
    assert 2 <= len(summary.strip().splitlines()) <= 6
    for module, path in SOURCES.items():
        if _room(module) == room and path.name != "__init__.py":
            assert f"`{path.name}`" in files or f"/{path.name}`" in files, f"{module} is not in the list of files"
    assert door.__all__
    for name in door.__all__:
        assert getattr(door, name, None) is not None, name


def test_tests_enter_by_doors() -> None:
    """They import from the doors of rooms, and commands by their files.

    The place behind a door where a test puts a fault in, or makes a limit small, is a text for `setattr`.
    """
    for path in sorted((ROOT / "tests").rglob("*.py")):
        for module in {name for name, _ in _names_imported_by_programs(path)}:
            is_inside = module.partition(".")[0] in ORDER and not module.startswith("hsplat_cli.commands.")
            assert not is_inside or _is_door(module), f"{path} imports {module}, which is behind a door"


def test_names_for_tests_alone_are_used_by_tests_alone() -> None:
    tested = {each for path in (ROOT / "tests").rglob("*.py") for each in _names_imported_by_programs(path)}
    for room in ROOMS:
        names = {name for name, is_for_tests in _offers(room).items() if is_for_tests}
        used = {name for path in SOURCES.values() for module, name in _imported_names(path) if module == room}
        assert not names & used, f"{room} offers names to tests alone that other rooms use"
        assert {(room, name) for name in names} <= tested, f"{room} offers names that no test uses"


def test_only_one_room_makes_opengl_calls() -> None:
    users = {module for module, path in SOURCES.items() if {"moderngl", "OpenGL", "glcontext"} & _imports(path)}
    assert users and all(module.startswith("renderer.draw.splats.") for module in users)


def test_kernels_include_one_way() -> None:
    """A folder of kernels has the name of their room. The truth shares no code with the kernels that it checks."""
    order = ["base", *ORDER["renderer"]]
    for path in source_files():
        folder = path.parent.name
        for other, name in re.findall(r'^#include "(.*)/(.*)"', path.read_text("ascii"), re.MULTILINE):
            is_above = order.index(other) <= order.index(folder) or path.name == "sizes.cpp"
            is_independent = folder != "truth" or other in ("base", "truth") or name == "kernels.h"
            assert is_above and is_independent, f"{folder}/{path.name} includes {other}/{name}"


def test_files_can_be_read_at_one_sitting() -> None:
    for path in {*SOURCES.values(), *source_files(), *(ROOT / "tests").rglob("*.py")} - MADE:
        assert len(path.read_text("utf-8").splitlines()) <= MAX_FILE_LINES, path
