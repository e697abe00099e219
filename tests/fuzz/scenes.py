"""Legal scenes and small volumes, drawn from a seed: the number of a scene is all that is needed to make it again."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from volume_files import in_memory

from renderer.scene import MIN_TOLERANCE
from renderer.volume import Array, Float64, Volume, make_volume

Tree = dict[str, Any]
Random = np.random.Generator

# What the schema calls legal, as far as scenes are drawn from it; everything that is generated keeps to this table.
LENGTH = (1e-9, 1e9)  # of a voxel's finest side, world units
SPACING_RATIO = 1e3  # of the longest to the finest side
OFFSET = 1e6  # of a volume from the world's origin, in lengths of its diagonal
UNIT = (1e-3, 1e3)  # of an opacity, in finest spacings
FIELD_OF_VIEW = (0.01, 179.0)
ZOOM = (0.1, 30.0)
DISTANCE = (1e-2, 1e3)  # of the eye, in diagonals
SMALLEST_VIEW = 1e-3  # half the height that is seen at the target without a zoom, in diagonals
TOLERANCES = (0.0, 1e-300, 1e-6, 10.0, 1e6, 1e300)
SPLATS = (1, 1000)
OPACITIES = (0.0, 1e-12, 1e-6, 0.01, 0.1, 0.5, 0.9, 1 - 1e-12, 1.0)
LARGEST_VALUE = 1e300  # of a voxel
EXACT_INTEGER = 2**53 - 3  # that float64 tells from its neighbours

AXIS_LENGTHS = (1, 1, 2, 3, 3, 4, 5, 5, 7, 8, 9)
LONGEST_AXIS = 200
LARGEST_SIDE_PX = 40
INTEGRATED = 0.2  # the share of scenes that are drawn in bricks
RESPACED = 0.3  # the share of files with headers whose spacing the scene gives
COLORMAPS = ("viridis", "gray", "cividis_r", "crameri:batlow")
DTYPES = (
    "uint8", "uint8", "int8", "uint16", "int16", "uint32", "int32", "uint64", "int64", "float16", "float32", "float64",
)  # fmt: skip


@dataclass
class Case:
    """A scene to be judged.

    tree: the scene as plain data. files: what lies beside it, by name. frame: the one to draw.
    volume: what must be read, where that is known; `in_memory`: it is drawn instead of the scene's own.
    spoilt: what was done to it, or nothing for a scene that is legal. text: the scene file, if it is not that of
    the tree. arguments: for the command line, beside the scene and the frame.
    """

    index: int
    tree: Tree
    files: dict[str, bytes]
    frame: int
    volume: Volume | None
    in_memory: bool = False
    spoilt: str = ""
    text: bytes | None = None
    arguments: list[str] = field(default_factory=list)


def random_of(seed: int, index: int) -> Random:
    """The random numbers of one scene."""
    return np.random.default_rng([seed, index])


def legal_case(index: int, rng: Random, dtypes: Sequence[str] = DTYPES) -> Case:
    """A scene that must give a picture."""
    values = random_values(rng, np.dtype(_one_of(rng, dtypes)))
    tree, files, volume, in_memory = _with_source(rng, values, random_of(index, 3))
    low, high = float(volume.values.min()), float(volume.values.max())
    tree["transfer_function"] = random_transfer(rng, low, high, volume.finest_spacing)
    tree["camera"] = random_camera(rng, volume)
    num_frames = tree["camera"]["path"]["frames"]
    tree["error"] = random_error(rng, num_frames, (low, high))
    tree["splat"] = random_splat(rng)
    # From numbers of their own, so that all others are the scenes that they were.
    if random_of(index, 2).random() < INTEGRATED:
        tree["splat"] = {"footprint": "integrated"}
    _maybe(rng, 0.4, lambda: tree.update(pyramid=random_pyramid(rng)))
    _maybe(rng, 0.25, lambda: tree.update(shading=random_shading(rng)))
    _maybe(rng, 0.1, lambda: tree.update(annotation={"octree": True}))
    tree["output"] = {
        "file": "out/{frame:02}.png",
        "size": [int(rng.integers(1, LARGEST_SIDE_PX + 1)) for _ in range(2)],
        "background": _one_of(rng, ["black", "white", "transparent", [0.2, 0.4, 0.6]]),
    }
    return Case(index, tree, files, int(rng.integers(num_frames)), volume, in_memory)


def _maybe(rng: Random, probability: float, change: Callable[[], None]) -> None:
    if rng.random() < probability:
        change()


def _one_of(rng: Random, things: Sequence[Any]) -> Any:
    return things[int(rng.integers(len(things)))]


def _between(rng: Random, limits: tuple[float, float]) -> float:
    """Even in the logarithm."""
    return float(min(max(10 ** rng.uniform(*np.log10(limits)), limits[0]), limits[1]))


# Voxels


def random_values(rng: Random, dtype: np.dtype[Any]) -> Array:
    """[z, y, x] of some shape: constants, steps, spikes, noise, ramps, at the limits of the type or near 0."""
    shape = [int(_one_of(rng, AXIS_LENGTHS)) for _ in range(3)]
    kind = rng.random()
    if kind < 0.05:
        shape = [1, 1, 1]
    elif kind < 0.15:
        shape = [1, 1, int(rng.integers(1, 40))]
    elif kind < 0.19:
        shape = [1, int(rng.integers(1, 3)), int(rng.integers(10, LONGEST_AXIS + 1))]
    rng.shuffle(shape)
    unit = _pattern(rng, shape)  # in [0, 1]
    if dtype.kind == "f":
        low, high = _float_range(rng, np.finfo(dtype))
        return (low + unit * (high - low)).astype(dtype)
    info = np.iinfo(dtype)
    low, high = int(info.min), int(info.max)
    if rng.random() < 0.3:
        middle = int(np.clip(int(rng.integers(low, high, dtype=dtype)), -EXACT_INTEGER, EXACT_INTEGER))
        low, high = max(low, middle - 3), min(high, middle + 3)
    span = high - low
    # Python's integers: 64 bits have no room for the span.
    flat = [min(low + round(share * span), high) for share in unit.ravel().tolist()]
    return np.array(flat, dtype).reshape(unit.shape)


def _pattern(rng: Random, shape: Sequence[int]) -> Float64:
    kind = _one_of(rng, ["constant", "noise", "noise", "ramp", "step", "spike", "smooth"])
    if kind == "constant":
        return np.full(shape, rng.random())
    if kind == "noise":
        return rng.random(shape)
    grids = np.meshgrid(*(np.linspace(0, 1, n) for n in shape), indexing="ij")
    along = np.asarray(np.tensordot(rng.dirichlet([1, 1, 1]), np.stack(grids), axes=1), np.float64)
    if kind == "ramp":
        return np.clip(along, 0, 1)
    if kind == "step":
        return (along > 0.5).astype(np.float64)
    if kind == "smooth":
        return 0.5 + 0.5 * np.sin(7 * along)
    spike = np.zeros(shape)
    spike[tuple(int(rng.integers(n)) for n in shape)] = 1.0
    return spike


def _float_range(rng: Random, info: np.finfo[Any]) -> tuple[float, float]:
    largest = min(float(info.max), LARGEST_VALUE)
    kind = rng.random()
    if kind < 0.5:
        return 0.0, 1.0
    if kind < 0.6:
        return -largest, largest
    if kind < 0.7:
        return 0.0, 100 * float(info.smallest_subnormal)
    if kind < 0.85:  # far from 0 and close together
        offset = float(_one_of(rng, [1e3, -1e4])) if info.bits == 16 else float(_one_of(rng, [1e6, -1e6]))
        return offset, offset + 64 * float(np.spacing(np.array(abs(offset), info.dtype)))
    size = _between(rng, (float(info.smallest_normal), largest))
    return -size, size


# Where the voxels come from


def _with_source(rng: Random, values: Array, of_spacing: Random) -> tuple[Tree, dict[str, bytes], Volume, bool]:
    """The scene so far, the files, the volume that they hold, and whether it is none of theirs.

    of_spacing: numbers of their own for spacings in place of the files', so that all others are what they were.
    """
    kind = _one_of(rng, ["npy", "npy", "raw", "raw", "memory", "memory"])
    affine = np.eye(4)
    if kind != "npy":
        affine = random_affine(rng, values.shape[::-1], is_plain=kind == "raw")
    tree: Tree = {"version": 1}
    spacing = [float(length) for length in np.diag(affine)[:3]]
    files: dict[str, bytes] = {}
    if kind == "npy":
        files["v.npy"] = in_memory(np.save, np.asfortranarray(values) if rng.random() < 0.3 else values)
        tree["volume"] = {"file": "v.npy"}
    elif kind == "raw":
        order = _one_of(rng, ["little", "big"])
        offset = _one_of(rng, [0, 0, 7])
        files["v.raw"] = (
            bytes(offset) + values.astype(values.dtype.newbyteorder("<" if order == "little" else ">")).tobytes()
        )
        tree["volume"] = {
            "raw": {
                "file": "v.raw", "shape": list(values.shape[::-1]), "dtype": values.dtype.name, "byte_order": order,
                "spacing": spacing, "offset": offset,
            }
        }  # fmt: skip
    else:  # something to find in its place
        files["v.npy"] = in_memory(np.save, values[:1, :1, :1])
        tree["volume"] = {"file": "v.npy"}
    if kind == "npy" and of_spacing.random() < RESPACED:
        affine = random_affine(of_spacing, values.shape[::-1], is_plain=True)
        tree["volume"]["spacing"] = [float(length) for length in np.diag(affine)[:3]]
    first = [0, 0, 0]
    if kind != "memory" and rng.random() < 0.15:
        crop = [sorted(rng.choice(n + 1, 2, replace=False).tolist()) for n in values.shape[::-1]]
        tree["volume"]["crop"] = crop
        values = values[tuple(slice(*pair) for pair in crop[::-1])]
        first = [pair[0] for pair in crop]
    affine[:3, 3] += affine[:3, :3] @ first
    return tree, files, make_volume(np.array(values, order="C"), affine, "expected"), kind == "memory"


def random_affine(rng: Random, shape_xyz: Sequence[int], *, is_plain: bool) -> Float64:
    """Return spacings within the table, unless plain turned or mirrored, sheared, and far from the origin, too."""
    finest = 1.0 if rng.random() < 0.5 else _between(rng, LENGTH)
    ratios = np.ones(3)
    if rng.random() < 0.5:
        ratios = SPACING_RATIO ** (rng.uniform(0, 1, 3) * rng.uniform(0, 1))
    affine = np.eye(4)
    affine[:3, :3] = np.diag(finest * ratios / ratios.min())
    if is_plain:
        return affine
    if rng.random() < 0.3:
        affine[:3, :3] = (np.eye(3) + np.triu(rng.uniform(-0.5, 0.5, (3, 3)), 1)) @ affine[:3, :3]
    if rng.random() < 0.7:
        affine[:3, :3] = np.linalg.qr(rng.standard_normal((3, 3)))[0] @ affine[:3, :3]
    if rng.random() < 0.5:
        diagonal = float(np.linalg.norm(affine[:3, :3] @ np.array(shape_xyz)))
        affine[:3, 3] = rng.uniform(-1, 1, 3) * diagonal * _between(rng, (1.0, OFFSET))
    return affine


# The other sections


def random_transfer(rng: Random, low: float, high: float, spacing: float) -> Tree:
    """Ramps, steps and spikes about the values that there are."""
    span = high - low if high > low else max(abs(high), 1.0)
    span = min(span, LARGEST_VALUE)
    num = int(rng.integers(1, 6))
    values = sorted(float(low / 2 + share * span / 2) * 2 for share in rng.uniform(-0.3, 1.3, num))
    if rng.random() < 0.2:
        values = sorted([*values, low, high])
    if rng.random() < 0.3:  # a step
        values = sorted([*values, values[int(rng.integers(len(values)))]])
    values = [value for k, value in enumerate(values) if k < 2 or not value == values[k - 1] == values[k - 2]]
    opacities = [float(_one_of(rng, OPACITIES)) if rng.random() < 0.5 else float(rng.random()) for _ in values]
    if not any(opacities):
        opacities[-1] = 0.5
    tree: Tree = {}
    if rng.random() < 0.8:
        tree["points"] = [
            {"value": value, "color": [float(part) for part in rng.random(3)], "opacity": opacity}
            for value, opacity in zip(values, opacities, strict=True)
        ]
    else:
        tree |= {"colormap": _one_of(rng, COLORMAPS), "range": [low, high if high > low else low + span]}
        tree["opacity"] = [[value, opacity] for value, opacity in zip(values, opacities, strict=True)]
    if rng.random() < 0.5:
        tree["unit"] = spacing * _between(rng, UNIT)
    return tree


def random_camera(rng: Random, volume: Volume) -> Tree:
    """Outside, inside, on a face, at a voxel's centre, along an axis; any path."""
    diagonal = float(np.linalg.norm(volume.world_from_index[:3, :3] @ np.array(volume.shape_xyz)))
    camera: Tree = {"projection": _one_of(rng, ["perspective", "perspective", "orthographic"])}
    kind = rng.random()
    if kind < 0.5:
        camera["field_of_view"] = float(rng.uniform(5, 120))
    elif kind < 0.6:
        camera["field_of_view"] = _between(rng, FIELD_OF_VIEW)
    elif kind < 0.65:
        camera["field_of_view"] = float(_one_of(rng, FIELD_OF_VIEW))
    if rng.random() < 0.2:
        camera["near"] = diagonal * float(rng.uniform(0, 1.5))
    camera["path"] = random_path(rng)
    kind = rng.random()
    if kind < 0.25:
        camera["target"] = "visible"
    elif kind < 0.5:
        camera["target"] = _point(rng, volume)
    if rng.random() < 0.5:
        camera["distance"] = diagonal * _between(rng, DISTANCE)
        reach = camera["distance"] * math.tan(math.radians(camera.get("field_of_view", 30.0)) / 2)
        if reach < SMALLEST_VIEW * diagonal:
            camera["field_of_view"] = 30.0
        if "near" in camera and camera["distance"] > 2 * diagonal:  # about the target, however far away
            camera["near"] += camera["distance"] - 0.75 * diagonal
    if rng.random() < 0.12:  # the eye at a special point: turned about +z, a multiple of 90 degrees or not
        azimuth, elevation = float(_one_of(rng, [0, 90, 180, 33])), float(_one_of(rng, [0, 90, -90, 20]))
        camera["path"] = {"type": "turntable", "frames": 1, "start": azimuth, "elevation": elevation}
        a, e = math.radians(azimuth), math.radians(elevation)
        toward = np.array([math.cos(e) * math.sin(a), -math.cos(e) * math.cos(a), math.sin(e)])
        camera["distance"] = diagonal * float(rng.uniform(0.3, 2))
        camera["target"] = [float(c) for c in np.array(_point(rng, volume)) - camera["distance"] * toward]
    return camera


def _point(rng: Random, volume: Volume) -> list[float]:
    """A voxel's centre, a corner, a point on a face or anywhere in the volume."""
    shape = np.array(volume.shape_xyz)
    inside = rng.uniform(-0.5, shape - 0.5)
    index = _one_of(rng, [inside, np.round(inside), np.where(rng.random(3) < 0.4, -0.5, inside), shape - 0.5])
    return [float(c) for c in volume.world_from_index[:3, :3] @ index + volume.world_from_index[:3, 3]]


def random_path(rng: Random) -> Tree:
    """Of one to five frames."""
    frames = int(rng.integers(1, 6))
    angle, elevation = float(rng.uniform(-400, 400)), float(_one_of(rng, [0, 90, -90, *rng.uniform(-90, 90, 3)]))
    if rng.random() < 0.3:
        angle = float(_one_of(rng, [0, 45, 90, 180, -90, 360]))
    axis = _one_of(rng, ["x", "y", "z", "z", "-x", "-y", "-z", [float(c) for c in rng.uniform(-1, 1, 3)]])
    kind = _one_of(rng, ["turntable", "turntable", "rocker", "keyframes"])
    path: Tree = {"type": kind, "frames": frames, "axis": axis}
    if kind == "turntable":
        return path | {"start": angle, "elevation": elevation}
    if kind == "rocker":
        return path | {"start": angle, "elevation": elevation, "swing": float(rng.uniform(0.1, 360))}
    at = sorted(rng.choice(frames, int(rng.integers(1, frames + 1)), replace=False).tolist())
    keys = [
        {"frame": frame, "azimuth": float(rng.uniform(-400, 400)), "elevation": float(rng.uniform(-90, 90)),
         "zoom": _between(rng, ZOOM)}
        for frame in at
    ]  # fmt: skip
    return path | {"keys": keys, "loop": bool(rng.random() < 0.5), "easing": _one_of(rng, ["smooth", "linear"])}


def random_error(rng: Random, num_frames: int, values: tuple[float, float]) -> Tree:
    """Any measure, tolerance or number of splats, and level."""
    error: Tree = {"measure": _one_of(rng, ["optical", "optical", "rms"])}
    tolerance = float(_one_of(rng, TOLERANCES)) if rng.random() < 0.4 else _between(rng, (1e-4, 2.0))
    if error["measure"] == "rms" and rng.random() < 0.4:
        error["of"] = "scalar"
        spread = max(values[1] / 2 - values[0] / 2, MIN_TOLERANCE)
        tolerance = min(max(tolerance * spread, MIN_TOLERANCE if tolerance else 0.0), 1e300)
    error["tolerance"] = tolerance
    if rng.random() < 0.15:
        error["tolerance"] = {frame: _between(rng, (1e-3, 1.0)) for frame in range(num_frames) if rng.random() < 0.6}
        error["tolerance"] |= {num_frames - 1: 0.1}
    if rng.random() < 0.15:
        error["finest_level"] = int(rng.integers(0, 5))
    if rng.random() < 0.2:
        del error["tolerance"]
        error["splats"] = round(_between(rng, SPLATS))
        if rng.random() < 0.4:
            error["splats"] = {frame: round(_between(rng, SPLATS)) for frame in range(num_frames) if frame % 2 == 0}
    return error


def random_splat(rng: Random) -> Tree:
    """Both footprints of splats."""
    splat: Tree = {"footprint": "gaussian"}
    _maybe(rng, 0.3, lambda: splat.update(sigma=float(rng.uniform(0.38, 2))))
    _maybe(rng, 0.2, lambda: splat.update(opacity_correction=False))
    _maybe(rng, 0.35, lambda: splat.update(order=_one_of(rng, ["boxes", "boxes", "unmixed"])))
    if rng.random() < 0.3:
        splat |= {"footprint": "gouraud", "angular": int(rng.integers(3, 13)), "radial": int(rng.integers(1, 6))}
        radii = [0.0, *sorted(float(r) for r in rng.uniform(0.05, 0.95, int(rng.integers(0, 3)))), 1.0]
        weights = [float(_one_of(rng, [0.0, 1.0, 0.5, w])) for w in rng.random(len(radii))]
        splat["profile"] = [[radius, weight] for radius, weight in zip(radii, weights, strict=True)]
        splat["profile"][0][1] = 1.0
    return splat


def random_pyramid(rng: Random) -> Tree:
    """Any average and precision."""
    return {"average": _one_of(rng, ["extinction", "opacity"]), "precision": _one_of(rng, ["half", "single"])}


def random_shading(rng: Random) -> Tree:
    """Any light."""
    return {
        "ambient": float(_one_of(rng, [0.0, 1.0, 0.3])),
        "diffuse": float(_one_of(rng, [0.0, 1.0, 0.7])),
        "light": [float(c) for c in rng.uniform(-1, 1, 3) * _between(rng, (1e-3, 1e3))],
    }
