"""Read a scene from plain data: nested mappings, lists and scalars, as a YAML or JSON reader gives them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from renderer.errors import Problem
from renderer.scene import schema
from renderer.scene.annotation_section import check_annotation
from renderer.scene.clip_section import check_what_is_clipped
from renderer.scene.layers_section import OPEN_LOOK, check_layers, name_mask, take_labels, take_layers
from renderer.scene.limits import proportion_problems, raise_problems
from renderer.scene.motion import is_plain
from renderer.scene.output_section import OutputSpec, check_frame_field
from renderer.scene.scene_writing import moving_values
from renderer.scene.schema import INVALID
from renderer.scene.spec import SECTIONS, FilmScene, Scene, film_scene
from renderer.scene.volume_section import WITHOUT_TRANSFER

# The largest number of key frames at which the values of a scene are compared with each other.
_MOST_CHECKED = 64


def parse_scene(tree: object, *, base: Path, is_single_frame: bool = False) -> FilmScene:
    """Return the scene that `tree` describes.

    base: the folder that volume files are relative to. The scene has `base / file` in their place; the output file
        stays as given.
    is_single_frame: whether only one frame is drawn, so that the output may be a PNG without a number in its name.
    Raises SceneError with every problem.
    """
    film = _film_time(tree)

    def read(at: int | None) -> tuple[Scene, list[Problem]]:
        node = schema.TreeNode(tree, "", [], base, film=replace(film, at=at))
        return _read_scene(node, is_single_frame=is_single_frame), node.problems

    scene, problems = read(None)
    keys = sorted(film.keys)
    # Values that move are compared with others as they are at frame 0, and then at keys.
    for frame in [*([0] if keys else []), *keys[:: len(keys) // _MOST_CHECKED + 1]]:
        known = {(problem.path, problem.what) for problem in problems}
        when = f"at frame {frame}: " if frame > 0 else ""
        new = [found for found in read(frame)[1] if (found.path, found.what) not in known]
        problems += [replace(found, what=f"{when}{found.what}") for found in new]
    raise_problems(problems)
    return film_scene(scene)


def _film_time(tree: object) -> schema.FilmTime:
    """Return the number of frames of a scene's film, or None if it is not given, and their rate, or the default."""
    sections, film = tree if isinstance(tree, Mapping) else {}, schema.FilmTime(None, OutputSpec.frames_per_second)
    output, camera = (schema.TreeNode(sections.get(key), "", [], film=film) for key in ("output", "camera"))
    found: Any = SECTIONS["output"].read(output)
    rate = getattr(found, "frames_per_second", INVALID)
    film = film if rate is INVALID else replace(film, frames_per_second=rate)
    found = SECTIONS["camera"].read(replace(camera, film=film))
    is_known = isinstance(getattr(getattr(found, "path", None), "frames", None), int)
    return schema.FilmTime(found.num_frames if is_known else None, film.frames_per_second)


def _read_scene(node: schema.TreeNode, *, is_single_frame: bool) -> Scene:
    """Return the scene in a tree. If there are problems, it is incomplete and must not be used."""
    tree, problems = node.value if isinstance(node.value, Mapping) else {}, node.problems
    required = _required_keys(tree)
    given = schema.read_fields(node, SECTIONS, required=required, misplaced_hints=_MISPLACED_KEY_HINTS)
    given.pop("version", None)
    take_labels(node, given)
    if "transfer_function" not in required and "volume" in required:
        given.setdefault("transfer_function", OPEN_LOOK)
    has_plain_values = is_plain(*(section for key, section in given.items() if key != "error"))
    if has_plain_values:
        check_layers(node, given)
    name_mask(node, given)
    check_what_is_clipped(node, given)
    if not is_single_frame:
        check_frame_field(node.child("output"), given)
    layers, shared = take_layers(given)
    scene = Scene(layers, shared=shared, **given)
    if not problems:  # values are compared only if each is correct
        for number, layer in enumerate(scene.layers if has_plain_values else ()):
            place = partial(scene.layer_key, number)
            problems += proportion_problems(layer.volume, scene.camera, scene.output.size, place)
        if node.film is not None and node.film.at is None:  # in a scene that is read at one frame, nothing moves
            section = node.child("annotation", tree.get("annotation"))
            moving = moving_values(film_scene(scene), 0) if scene.annotation.time is not None else {}
            check_annotation(section, scene.annotation, scene.layers, moving)
    return scene


def _required_keys(tree: Mapping[str, object]) -> list[str]:
    """Return the keys that this scene must have, in the order of a scene file."""
    volume = tree.get("volume")
    has_own_look = isinstance(volume, Mapping) and volume.get("component") in WITHOUT_TRANSFER
    if "volumes" in tree:
        of_volumes = []
    elif "labels" in tree or has_own_look:
        of_volumes = ["volume"]
    else:
        of_volumes = ["volume", "transfer_function"]
    return [*of_volumes, "camera", "output"]


# Hints for keys that users wrongly write at the top level of a scene: the section of each key, or its name today.
_MISPLACED_KEY_HINTS = {
    key: f"did you mean {place}.{key}?"
    for place, keys in {
        "error": ("tolerance", "psnr", "rmse", "seconds"),
        "camera.path": ("frames", "elevation"),
        "output": ("size", "background", "frames_per_second"),
        "splat": ("footprint",),
    }.items()
    for key in keys
} | {"cuts": "cuts is called clip now", "overlay": "overlay: bounds is written annotation: {bounds: true} now"}
