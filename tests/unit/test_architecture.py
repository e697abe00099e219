"""The program's structure as DESIGN draws it: imports go one way, duties stay in their rooms, files stay readable."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

MAX_FILE_LINES = 500
MAX_FUNCTION_LINES = 60

# Rooms of renderer/: their modules, and the other rooms that they may import from.
ROOMS: dict[str, tuple[str, str]] = {
    "words": ("errors mapped_file scene volume camera jit runs threads", ""),
    "checks": (
        "extents volume_files schema schema_camera schema_error schema_output schema_transfer schema_volume "
        "scene_schema colormaps",
        "words",
    ),
    "volumes": ("readers procedural far_values ranks statistics", "words checks"),
    "suggestions": ("evidence exposure looks labels level_sets suggestion unseen", "words checks volumes"),
    "classification": ("transfer classify", "words checks"),
    "pyramid": ("pyramid pyramid_blocks pyramid_kernels pyramid_memory emptiness", "words classification"),
    "cut": ("octree cut_sizes visibility depth_directions", "words classification pyramid"),
    "path": ("camera_paths framing schedule", "words pyramid cut"),
    "bricks": (
        "bricks between_voxels brick_kernels brick_means brick_sizes brick_sums brick_texels optical_pieces",
        "words classification pyramid cut",
    ),
    "splats": ("splats brick_batch projection brick_projection cell_edges", "words classification pyramid cut bricks"),
    "raster": (
        "raster_gl raster_cpu gl_atlas gl_bricks cpu_atlas cpu_bricks cpu_bricks_kernel cpu_field brick_atlas "
        "brick_store brick_picture brick_memory lattices raster_lasting raster_reference raster_bricks_reference "
        "compositing shaders",
        "words classification pyramid bricks splats",
    ),
    "truth": ("cubic integrator integrator_kernel", "words"),
    "film": (
        "film encode frame_record kept_frames output_files output_lock picture png quantize sidecar staging "
        "stream_tail",
        "words",
    ),
    "frame": (
        "families splat_family brick_family drawing costs pacing parcel",
        "words checks volumes classification pyramid cut path bricks splats film",
    ),
    "contents": ("pipeline", "words checks volumes classification pyramid cut path bricks splats film frame"),
    "study": (
        "frame_difference metrics pareto search strictness study sweep sweep_plan thumbnails tolerances trials truths "
        "want",
        "words checks classification pyramid cut path bricks splats truth film frame contents",
    ),
}
# The doors of renderer/ to the command line.
COMMANDS_MAY_IMPORT = {
    "errors", "scene", "schema", "scene_schema", "schema_camera", "schema_error", "schema_output", "want",  # quick
    "output_files", "volume_files",  # quick, too
    "readers", "volume", "statistics",  # info
    "mapped_file",  # what shrinks
    "drawing", "pacing", "costs", "pipeline", "raster_gl", "raster_cpu", "raster_lasting", "film", "sidecar",  # render
    "brick_memory", "jit",  # render
    "frame_record", "kept_frames", "output_lock", "picture", "parcel", "runs", "stream_tail",  # render
    "metrics", "pareto", "schedule", "study", "sweep", "sweep_plan", "tolerances", "trials", "truths",  # measure
    "bricks", "png", "staging",  # reports
    "encode", "frame_difference", "strictness",  # compare
    "camera", "thumbnails", "transfer",  # peers
    "colormaps", "extents", "suggestion", "unseen",  # scenes without a scene file
    "integrator", "octree", "splats",  # paper
}  # fmt: skip

GL_PACKAGES = {"moderngl", "OpenGL", "glcontext"}
GL_OWNERS = {"renderer.draw.gl.raster", "renderer.draw.gl.atlas", "renderer.draw.gl.bricks"}
# What renderer/ must not know: the clock, the terminal, the command line, randomness without a seed.
FOREIGN_TO_RENDERER = {"time", "datetime", "random", "secrets", "argparse", "click", "tqdm"}
SAYING_OR_ASKING = {"print", "input", "breakpoint", "exit", "quit"}
DANGEROUS = {"eval", "exec", "compile", "__import__"}


def sources() -> list[Path]:
    return sorted(path for package in ("renderer", "hsplat_cli") for path in (ROOT / package).rglob("*.py"))


@cache
def tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"), filename=str(path))


def module(path: Path) -> str:
    """`renderer.readers.tiff`."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


@cache
def modules() -> frozenset[str]:
    return frozenset(map(module, sources()))


def imports(path: Path) -> Iterator[str]:
    """Full names of the modules that are imported anywhere in a file, also those imported from a package."""
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: a relative import"
            assert node.module is not None
            children = {f"{node.module}.{alias.name}" for alias in node.names}
            yield from sorted(children & modules()) or [node.module]


def renderer_module(name: str) -> str | None:
    """`readers` of `renderer.readers.tiff`; None outside of renderer/."""
    package, _, rest = name.partition(".")
    return rest.partition(".")[0] if package == "renderer" and rest else None


def room_of(name: str) -> str:
    return next(room for room, (modules, _) in ROOMS.items() if name in modules.split())


RENDERER = [path for path in sources() if module(path).startswith("renderer")]


def test_every_module_has_one_room() -> None:
    there = {name for path in RENDERER if (name := renderer_module(module(path)))}
    listed = [name for modules, _ in ROOMS.values() for name in modules.split()]
    assert there == set(listed)
    assert len(listed) == len(set(listed))


def test_the_rooms_have_an_order() -> None:
    """Each opens only into rooms above it in the table, so that no chain of imports comes back."""
    rooms = list(ROOMS)
    for number, (_, above) in enumerate(ROOMS.values()):
        assert set(above.split()) <= set(rooms[:number])


@pytest.mark.parametrize("path", RENDERER, ids=module)
def test_imports_go_one_way(path: Path) -> None:
    own = renderer_module(module(path))
    if own is None:  # renderer/__init__.py
        assert list(imports(path)) == []
        return
    room = room_of(own)
    allowed = {room, *ROOMS[room][1].split()}
    for name in imports(path):
        assert not name.startswith("hsplat_cli"), f"renderer must not know the command line: {name}"
        other = renderer_module(name)
        if other is not None:
            assert room_of(other) in allowed, f"{own} is in {room}, which does not open into {room_of(other)}: {name}"


@pytest.mark.parametrize("path", [path for path in sources() if path not in RENDERER], ids=module)
def test_commands_use_few_doors(path: Path) -> None:
    used = {other for name in imports(path) if (other := renderer_module(name))}
    assert used <= COMMANDS_MAY_IMPORT


def test_commands_do_not_need_each_other_in_a_circle() -> None:
    """The folders of hsplat_cli/ have an order, in which hsplat_cli/ itself, with what they share, is the first."""
    needs: dict[str, set[str]] = {}
    for path in sources():
        if path not in RENDERER:
            folder = module(path.parent)
            used = {name.rpartition(".")[0] for name in imports(path) if name.startswith("hsplat_cli.")}
            needs.setdefault(folder, set()).update(used - {folder})
    assert next(iter(TopologicalSorter(needs).static_order())) == "hsplat_cli"  # CycleError where there is none


@pytest.mark.parametrize("path", RENDERER, ids=module)
def test_gl_has_few_owners(path: Path) -> None:
    packages = {name.partition(".")[0] for name in imports(path)}
    assert bool(packages & GL_PACKAGES) == (module(path) in GL_OWNERS)


@pytest.mark.parametrize("path", RENDERER, ids=module)
def test_renderer_is_silent_and_timeless(path: Path) -> None:
    assert {name.partition(".")[0] for name in imports(path)} & FOREIGN_TO_RENDERER == set()
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.Name):
            assert node.id not in SAYING_OR_ASKING, f"line {node.lineno}: {node.id}"
        if isinstance(node, ast.Attribute):
            name = ast.unparse(node)
            assert name not in {
                "os.environ",
                "os.getenv",
                "os.cpu_count",
                "sys.stdout",
                "sys.stderr",
                "sys.exit",
            }, f"line {node.lineno}"
            if name.startswith(("np.random.", "numpy.random.")):
                assert node.attr in {"Generator", "PCG64"}, f"line {node.lineno}: {name} has a global state"


@pytest.mark.parametrize("path", sources(), ids=module)
def test_nothing_dangerous(path: Path) -> None:
    assert {name.partition(".")[0] for name in imports(path)} & {"pickle", "shelve", "marshal"} == set()
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            assert node.func.id not in DANGEROUS, f"line {node.lineno}: {node.func.id}"
        if isinstance(node, ast.keyword):
            assert node.arg != "shell", f"line {node.lineno}: a shell"
        assert not isinstance(node, ast.Global), "global state"
        assert not (isinstance(node, ast.ExceptHandler) and node.type is None), "a bare except"


@pytest.mark.parametrize("path", [*sources(), *sorted((ROOT / "tests").rglob("*.py"))], ids=module)
def test_files_and_functions_can_be_read(path: Path) -> None:
    num_lines = len(path.read_text(encoding="utf-8").splitlines())
    assert num_lines <= MAX_FILE_LINES
    for node in ast.walk(tree(path)):
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            assert node.end_lineno is not None
            length = node.end_lineno - node.lineno + 1
            assert length <= MAX_FUNCTION_LINES, f"line {node.lineno}: {node.name} has {length} lines"


@pytest.mark.parametrize("path", sources(), ids=module)
def test_what_is_public_has_a_docstring(path: Path) -> None:
    content = tree(path)
    if content.body:
        assert ast.get_docstring(content), "the module"
    for name, node in public(content):
        assert ast.get_docstring(node), f"line {node.lineno}: {name}"


def public(parent: ast.Module | ast.ClassDef) -> Iterator[tuple[str, ast.FunctionDef | ast.ClassDef]]:
    """Public functions, classes and methods; not methods that say what their base class has said."""
    inherits = isinstance(parent, ast.ClassDef) and bool(parent.bases)
    for node in parent.body:
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)) and not node.name.startswith("_"):
            if not (inherits and isinstance(node, ast.FunctionDef)):
                yield node.name, node
            if isinstance(node, ast.ClassDef):
                yield from public(node)
