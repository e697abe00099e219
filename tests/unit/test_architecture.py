"""The rooms: imports go one way and through doors, files can be read at one sitting.

What else holds for the code (silence, no clock, nothing dangerous, docstrings) is checked by ruff; see pyproject.toml.
"""

from __future__ import annotations

import ast
import importlib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
MAX_FILE_LINES = 500

# The rooms of each package in their order: each may use those before it. Modules beside the rooms come after the first
# of them in renderer/, and after all of them in hsplat_cli/. The Python API uses all rooms; none uses it.
ORDER = {
    "renderer": [
        "system", "kernels", "volume", "looks", "scene", "readers", "transfer", "suggest", "pyramid", "lighting",
        "splats", "bricks", "view", "modes", "layers", "draw", "film", "frame", "truth", "accuracy", "annotation",
        "record", "job",
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
    """`renderer.draw` of `renderer.draw.gl.splat_rasterizer`; the package of a module that is in no room.

    Of the door of `renderer` it is the API, whose names it has.
    """
    if module in ("renderer", API, f"{API}_scenes"):
        return API
    room = ".".join(module.split(".")[:2])
    return room if room in ROOMS else module.partition(".")[0]


@cache
def _imports(path: Path) -> frozenset[str]:
    return frozenset(_imported(path))


def _imported(path: Path) -> Iterator[str]:
    """Full names of the modules that a file imports, also of those imported by name from their package."""
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0 and node.module, f"{path}: a relative import"
            children = {f"{node.module}.{alias.name}" for alias in node.names}
            yield from children & set(SOURCES) or {node.module}


def _is_door(module: str) -> bool:
    """A room, a module that its room offers, one beside the rooms, or one that another program finds by its name."""
    parent, _, name = module.rpartition(".")
    is_offered = parent in ROOMS and name in importlib.import_module(parent).__all__
    is_known = module in (*ROOMS, "renderer", "hsplat_cli.compare.pytest_plugin")
    return is_offered or is_known or _room(module) in ORDER


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


def test_only_one_room_makes_opengl_calls() -> None:
    users = {module for module, path in SOURCES.items() if {"moderngl", "OpenGL", "glcontext"} & _imports(path)}
    assert users and all(module.startswith("renderer.draw.gl.") for module in users)


def test_files_can_be_read_at_one_sitting() -> None:
    kernels = (path for path in (ROOT / "renderer" / "kernels" / "sources").iterdir() if path.name != "kernels.h")
    for path in [*SOURCES.values(), *kernels, *(ROOT / "tests").rglob("*.py")]:
        assert len(path.read_text("utf-8").splitlines()) <= MAX_FILE_LINES, path
