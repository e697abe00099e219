"""The frozen description of a job: the content of `scene.yaml` with every default filled in; from plain data and back.

The plain data come from a YAML or JSON reader: nested mappings, lists and scalars.

Each large section of a scene has its own module (`volume_section`, `transfer_section`, `camera_section`,
`error_section`, `splat_section`, `shading_section`, `mode_section`, `clip_section`, `annotation_section`,
`output_section`) with its dataclass: for each key the type that checks it, and its default. Nothing here imports numpy
or OpenGL, so that `hsplat check` answers at once. Lengths are in world units (those of the volume's spacing), angles in
degrees, colours in [0, 1] as given (display-referred), shapes, points and sizes in (x, y, z) and (width, height) order.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

from renderer.errors import Problem
from renderer.scene import schema
from renderer.scene.annotation_section import ANNOTATION_SECTION, AnnotationSpec, check_annotation
from renderer.scene.camera_section import CAMERA_FIELD, CameraPath, CameraSpec, PathSequence
from renderer.scene.clip_section import CLIP_SECTION, ClipSpec, check_what_is_clipped
from renderer.scene.error_section import ERROR_SECTION, ErrorSpec, schedule_to_dict
from renderer.scene.labels_section import MASK_SECTION, LabelsSpec, MaskSpec
from renderer.scene.layers_section import OF_CHANNELS, VOLUMES_SECTION, LayerSpec, check_layers, name_mask, take_labels
from renderer.scene.limits import proportion_problems, raise_problems
from renderer.scene.message_text import format_value, join_keys
from renderer.scene.mode_section import MODE_SECTION, ModeSpec
from renderer.scene.motion import motion_of, motion_to_dict, motions_in, values_at
from renderer.scene.output_section import OUTPUT_SECTION, OutputFile, OutputSpec, check_frame_field
from renderer.scene.schema import INVALID
from renderer.scene.shading_section import ShadingSpec
from renderer.scene.splat_section import SPLAT_SECTION, SplatSpec, unused_splat_keys
from renderer.scene.transfer_section import LABELS_FIELD, TRANSFER_FUNCTION_SECTION, ColormapSpec, TransferSpec
from renderer.scene.volume_files import FileSource
from renderer.scene.volume_section import VOLUME_SECTION, VOLUME_TABLE, WITHOUT_TRANSFER, ArraySource, VolumeSpec

VERSION = 1

# The most key frames at which the values of a scene are compared with each other.
_MOST_CHECKED = 64


def _parse_version(node: schema.TreeNode) -> Any:
    is_known = schema.parse_whole_number(node.value) == VERSION
    return VERSION if is_known else node.reject("unknown version of the scene format")


_VERSION = schema.FieldType(str(VERSION), _parse_version)


@dataclass(frozen=True)
class PyramidSpec:
    """A choice of what a node averages, and of the precision in which it is stored."""

    average: Literal["extinction", "opacity"] = "extinction"
    precision: Literal["half", "single"] = "half"


@dataclass(frozen=True)
class Scene:
    """A complete job.

    volumes: several, in place of one; then `volume` and `transfer_function` are those of the first. blend: `mix` adds
        extinctions up, and colours in their proportion; `add` adds light that nothing absorbs, as of fluorescence.
    """

    volume: Annotated[VolumeSpec, VOLUME_SECTION]
    transfer_function: Annotated[TransferSpec, TRANSFER_FUNCTION_SECTION]
    camera: Annotated[CameraSpec, CAMERA_FIELD]
    output: Annotated[OutputSpec, OUTPUT_SECTION]
    error: Annotated[ErrorSpec, ERROR_SECTION] = field(default=ErrorSpec())
    splat: Annotated[SplatSpec, SPLAT_SECTION] = field(default=SplatSpec("integrated"))
    pyramid: PyramidSpec = PyramidSpec()
    shading: ShadingSpec | None = None
    mode: Annotated[ModeSpec, MODE_SECTION] = field(default=ModeSpec())
    clip: Annotated[tuple[ClipSpec, ...], CLIP_SECTION] = ()
    mask: Annotated[MaskSpec | None, MASK_SECTION] = None
    volumes: Annotated[tuple[LayerSpec, ...], VOLUMES_SECTION] = ()
    blend: Literal["mix", "add"] = "mix"
    annotation: Annotated[AnnotationSpec, ANNOTATION_SECTION] = field(default=AnnotationSpec())
    version: Annotated[int, _VERSION] = VERSION

    @property
    def layers(self) -> tuple[LayerSpec, ...]:
        """Return what is drawn: the volumes, or the only one. Those without shading or mask have the scene's."""
        if not self.volumes:
            return (LayerSpec(self.volume, self.transfer_function, self.shading, mask=self.mask),)
        shading, mask = self.shading, self.mask
        return tuple(replace(each, shading=each.shading or shading, mask=each.mask or mask) for each in self.volumes)

    def at(self, frame: int) -> Scene:
        """Return the scene with plain numbers, as it is at a frame; itself if nothing moves."""
        at_frame: Scene = values_at(self, frame)
        return at_frame

    @property
    def moves(self) -> bool:
        """Return whether anything but its tolerance moves."""
        return any(motions_in(replace(self, error=ErrorSpec())))

    @property
    def num_frames(self) -> int:
        """Return the number of frames of the film."""
        return self.camera.num_frames

    @property
    def key_frames(self) -> list[int]:
        """Return the frames at which something that moves has a key, ascending."""
        return sorted({frame for motion in motions_in(self) for frame in motion.frames})

    @property
    def needs_opengl(self) -> bool:
        """Return whether it has splats; bricks are drawn by kernels."""
        return self.splat.footprint != "integrated"

    @property
    def import_notes(self) -> list[str]:
        """Return sentences on what an imported transfer function has that is not drawn."""
        notes = []
        for layer in self.layers:
            imported = layer.transfer_function.imported
            if imported is None:
                continue
            notes += [f"{imported.name}: not imported: {clause}" for clause in imported.left_out]
            if imported.shading and layer.shading is None:
                flow = ", ".join(f"{key}: {format_value(value)}" for key, value in imported.shading.items())
                notes.append(f"{imported.name}: to be lit as there, add shading: {{{flow}}}")
        return notes

    @property
    def key_for_bricks(self) -> str | None:
        """Return a key that only bricks can show, if it has one."""
        asks = {
            "mode": self.mode.is_projection,
            "clip": bool(self.clip),
            "labels": self.transfer_function.labels is not None,
            "volumes": bool(self.volumes),
            "shading": self.shading is not None and bool(self.shading.keys_for_bricks),
        }
        return next((key for key, is_asked in asks.items() if is_asked), None)


def parse_scene(tree: object, *, base: Path, is_single_frame: bool = False) -> Scene:
    """Return the scene that `tree` describes.

    base: the folder that volume files are relative to; they are kept as `base / file`, the output file as given.
    is_single_frame: one frame is drawn, so the output may be a PNG without a number in its name.
    Raises SceneError with every problem.
    """
    film, later = _film_time(tree), dict[tuple[str, str], Problem]()

    def read(at: int | None) -> tuple[Scene, list[Problem]]:
        node = schema.TreeNode(tree, "", [], base, film=replace(film, at=at))
        return _read_scene(node, is_single_frame=is_single_frame), node.problems

    scene, problems = read(None)
    keys = sorted(film.keys)
    for frame in keys[:: len(keys) // _MOST_CHECKED + 1]:  # values are compared as they are at keys
        for found in read(frame)[1]:
            later.setdefault((found.path, found.what), replace(found, what=f"at frame {frame}: {found.what}"))
    known = {(problem.path, problem.what) for problem in problems}
    raise_problems([*problems, *(problem for key, problem in later.items() if key not in known)])
    return scene


def _film_time(tree: object) -> schema.FilmTime:
    """Return how many frames a scene has, and their rate, as far as it gives them."""
    sections, film = tree if isinstance(tree, Mapping) else {}, schema.FilmTime(None, OutputSpec.frames_per_second)
    output, camera = (schema.TreeNode(sections.get(key), "", [], film=film) for key in ("output", "camera"))
    found: Any = _TABLE["output"].read(output)
    rate = getattr(found, "frames_per_second", INVALID)
    film = film if rate is INVALID else replace(film, frames_per_second=rate)
    found = _TABLE["camera"].read(replace(camera, film=film))
    is_known = isinstance(getattr(getattr(found, "path", None), "frames", None), int)
    return schema.FilmTime(found.num_frames if is_known else None, film.frames_per_second)


def _read_scene(node: schema.TreeNode, *, is_single_frame: bool) -> Scene:
    """Return the scene in a tree; of no use where there are problems."""
    tree, problems = node.value, node.problems
    has_volumes = isinstance(tree, Mapping) and "volumes" in tree
    only = tree.get("volume") if isinstance(tree, Mapping) and not has_volumes else None
    of_channels = isinstance(only, Mapping) and only.get("component") in WITHOUT_TRANSFER
    has_labels = isinstance(tree, Mapping) and "labels" in tree
    left_out = _OF_ONE_VOLUME if has_volumes else ("transfer_function",) if of_channels or has_labels else ()
    required = [key for key in schema.required_keys(Scene) if key not in left_out]
    given = schema.read_fields(node, SECTIONS, required=required, misplaced_hints=_MISPLACED_KEY_HINTS)
    take_labels(node, given)
    if of_channels:
        given.setdefault("transfer_function", OF_CHANNELS)
    check_layers(node, given)
    name_mask(node, given)
    check_what_is_clipped(node, given)
    if not is_single_frame:
        check_frame_field(node.child("output"), given)
    if has_volumes:
        first = given["volumes"][0] if isinstance(given["volumes"], tuple) else INVALID
        given |= {key: getattr(first, key, INVALID) for key in _OF_ONE_VOLUME}
    scene = Scene(**given)
    if not problems:  # values are compared only if each is correct
        for layer in scene.layers:
            problems += proportion_problems(layer.volume, scene.camera, scene.output.size)
        if node.film is not None and node.film.at is None:  # where a frame is read, nothing moves
            place = node.child("annotation", isinstance(tree, Mapping) and tree.get("annotation"))
            moving = moving_values(scene, 0) if scene.annotation.time is not None else {}
            check_annotation(place, scene.annotation, len(scene.layers), moving)
    return scene


_TABLE = schema.field_table(Scene)
SECTIONS: schema.FieldTable = {
    **{key: _TABLE[key] for key in ("volume", "transfer_function")},
    "labels": LABELS_FIELD,
} | _TABLE
_OF_ONE_VOLUME = ("volume", "transfer_function")

# Keys that users put at the top level, and where they belong, or what they are called now.
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


# Back to plain data


def scene_to_dict(scene: Scene) -> dict[str, Any]:
    """Return the scene as plain data for JSON or YAML, with every default written out.

    `parse_scene` makes the same scene from it: with any `base` if the volume's file is an absolute path, else in the
        same folder.
    """
    return {"version": scene.version} | spec_to_dict(scene)


def moving_values(scene: Scene, frame: int) -> dict[str, Any]:
    """Return what moves in a scene as it is at a frame: plain data by dotted keys."""

    def differences(film: Any, now: Any, path: str) -> Iterator[tuple[str, Any]]:
        if isinstance(film, list) and isinstance(now, list) and len(film) == len(now):
            film, now = dict(enumerate(film)), dict(enumerate(now))
        if isinstance(film, dict) and isinstance(now, dict) and film.keys() == now.keys():
            for key in film:
                yield from differences(film[key], now[key], join_keys(path, key))
        elif film != now:
            yield path, now

    return dict(differences(scene_to_dict(scene), scene_to_dict(scene.at(frame)), ""))


def without_sources(tree: Mapping[str, Any]) -> dict[str, Any]:
    """Return a scene as plain data without what says where its voxels come from, and which part of them is used."""

    def own(entry: Mapping[str, Any]) -> dict[str, Any]:
        mask = _without(entry.get("mask", {}), VOLUME_TABLE)
        return _without(entry, VOLUME_TABLE) | ({"mask": mask} if mask else {})

    rest = _without(own(tree), ["volume"])
    if "volumes" in tree:
        rest["volumes"] = [own(entry) for entry in tree["volumes"]]
    return rest


def spec_to_dict(value: Any) -> dict[str, Any]:
    """Return a part of a scene, such as a CameraSpec or a TransferSpec, as plain data; as `scene_to_dict`."""
    pairs = ((field.name, getattr(value, field.name)) for field in fields(value))
    plain = {name: _plain(item) for name, item in pairs if item is not None}  # None stands for a key that is not given
    for cls, change in _CHANGES.items():
        if isinstance(value, cls):
            return change(value, plain)
    return plain


def _without(plain: Mapping[str, Any], keys: Collection[str]) -> dict[str, Any]:
    return {key: item for key, item in plain.items() if key not in keys}


def _of_scene(scene: Scene, plain: dict[str, Any]) -> dict[str, Any]:
    left_out = [*_OF_ONE_VOLUME, "labels"] if scene.volumes else ["volumes"]
    if not scene.volumes and scene.volume.component != "all":
        left_out.append("blend")
    return _without(_with_look(scene, plain), left_out)


def _of_layer(layer: LayerSpec, plain: dict[str, Any]) -> dict[str, Any]:
    if layer.color is not None:
        del plain["transfer_function"]
    return _with_own_keys(plain.pop("volume"), _with_look(layer, plain))


def _with_look(value: Scene | LayerSpec, plain: dict[str, Any]) -> dict[str, Any]:
    """Return plain data with the key that says how a volume looks."""
    if value.transfer_function == OF_CHANNELS:
        return _without(plain, ["transfer_function"])
    if value.transfer_function.labels is not None:
        return {"labels" if key == "transfer_function" else key: item for key, item in plain.items()}
    return plain


def _of_mask(mask: MaskSpec, plain: dict[str, Any]) -> dict[str, Any]:
    labels, volume = _without(plain.pop("labels"), ["colors"]), plain.pop("volume")
    return _with_own_keys({"name": volume} if isinstance(volume, str) else volume, labels | plain)


def _with_own_keys(volume: dict[str, Any], own: dict[str, Any]) -> dict[str, Any]:
    return {**volume, **{key: item for key, item in own.items() if item not in ("", [])}}


def _of_labels(labels: LabelsSpec, plain: dict[str, Any]) -> dict[str, Any]:
    for key in ("colors", "opacity", "names"):
        if isinstance(pairs := getattr(labels, key), tuple):
            plain[key] = {label: _plain(item) for label, item in pairs}
    return {key: item for key, item in plain.items() if item != []}


def _of_volume(volume: VolumeSpec, plain: dict[str, Any]) -> dict[str, Any]:
    source: dict[str, Any] = plain.pop("source")
    if not volume.interpolate:  # which not all sources have
        del plain["interpolate"]
    return (source if isinstance(volume.source, FileSource) else {volume.source.key: source}) | plain


def _of_file(plain: dict[str, Any]) -> dict[str, Any]:
    spacing = {"spacing": plain["spacing"]} if "spacing" in plain else {}
    return {"file": plain.get("collection") or plain["steps"] or plain["file"]} | spacing


def _of_transfer(transfer: TransferSpec, plain: dict[str, Any]) -> dict[str, Any]:
    mapping = plain.pop("mapping")
    plain.pop("imported", None)
    if not transfer.relative:
        del plain["relative"]
    if isinstance(transfer.mapping, ColormapSpec):
        mapping = {"colormap": mapping.pop("name")} | mapping
    return ({"points": mapping} if transfer.points else mapping) | plain


def _of_outputs(output: OutputSpec, plain: dict[str, Any]) -> Any:
    others: list[dict[str, Any]] = plain.pop("others")
    first = _of_output(output, plain)
    return [first, *others] if others else first


def _of_output(output: OutputFile, plain: dict[str, Any]) -> dict[str, Any]:
    if output.every == 1:
        del plain["every"]
    return plain | {"background": _of_background(plain.get("background", "transparent"))}


def _of_background(plain: Any) -> Any:
    """Return a background with the keys of the ends of a gradient, which may move."""
    if isinstance(plain, dict):
        return {key: _of_background(item) for key, item in plain.items()}
    is_gradient = isinstance(plain, list) and not isinstance(plain[0], (int, float))
    return dict(zip(("top", "bottom"), plain, strict=True)) if is_gradient else plain


# What differs, for each part of a scene, between its fields and its keys.
_CHANGES: dict[Any, Callable[[Any, dict[str, Any]], dict[str, Any]]] = {
    Scene: _of_scene,
    LayerSpec: _of_layer,
    MaskSpec: _of_mask,
    LabelsSpec: _of_labels,
    VolumeSpec: _of_volume,
    FileSource: lambda _, plain: _of_file(plain),
    TransferSpec: _of_transfer,
    ErrorSpec: lambda error, plain: schedule_to_dict(error) | _without(plain, ("tolerance", "goal")),
    SplatSpec: lambda splat, plain: _without(plain, unused_splat_keys(splat.footprint)),
    OutputSpec: _of_outputs,
    OutputFile: _of_output,
    CameraPath: lambda path, plain: {"type": path.type} | plain,
}


def _plain(value: Any) -> Any:
    if (motion := motion_of(value)) is not None:
        return motion_to_dict(motion, _plain)
    if isinstance(value, PathSequence):
        return [_plain(piece) for piece in value.pieces]
    if isinstance(value, tuple):
        items = [_plain(item) for item in value]
        if None in items:  # a range for some of the axes
            return {axis: pair for axis, pair in zip("xyz", items, strict=True) if pair is not None}
        return items
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, ArraySource):
        return {"shape": list(value.shape), "dtype": str(value.values.dtype), "spacing": list(value.spacing)}
    return spec_to_dict(value) if is_dataclass(value) else value
