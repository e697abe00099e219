"""The frozen description of a job: the content of `scene.yaml` with every default filled in.

Each large section of a scene has its own module (`volume_section`, `transfer_section`, `camera_section`,
`error_section`, `splat_section`, `shading_section`, `light_section`, `fog_section`, `mode_section`, `clip_section`,
`annotation_section`, `output_section`) with its dataclass: for each key the type that checks it, and its default.
Nothing here imports numpy or OpenGL, so that `hsplat check` answers at once. Lengths are in world units (those of the
volume's spacing), angles in degrees, colours in [0, 1] as given (display-referred), shapes, points and sizes in
(x, y, z) and (width, height) order.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from typing import Annotated, Any, Literal, TypeVar, get_args

from renderer.scene import schema
from renderer.scene.annotation_section import ANNOTATION_SECTION, AnnotationSpec
from renderer.scene.camera_section import CAMERA_FIELD, CameraSpec
from renderer.scene.clip_section import CLIP_SECTION, MAX_CLIPS, ClipSpec
from renderer.scene.error_section import ERROR_SECTION, ErrorSpec
from renderer.scene.fog_section import FogSpec
from renderer.scene.labels_section import MASK_SECTION
from renderer.scene.layers_section import VOLUMES_SECTION, LayerSpec, SharedKeys
from renderer.scene.light_section import LightSpec
from renderer.scene.message_text import format_value
from renderer.scene.mode_section import MODE_SECTION, ModeSpec
from renderer.scene.motion import OverFrames, is_plain, values_at
from renderer.scene.output_section import OUTPUT_SECTION, OutputSpec
from renderer.scene.picture_kind import Background
from renderer.scene.shading_section import ShadingSpec
from renderer.scene.splat_section import SPLAT_SECTION, SplatSpec
from renderer.scene.transfer_section import LABELS_FIELD, TRANSFER_FUNCTION_SECTION
from renderer.scene.volume_section import VOLUME_SECTION, VOLUME_TABLE

VERSION = 1


# How layers are mixed: extinctions add up and colours mix in their proportion, or light adds up and nothing absorbs it.
Blend = Literal["mix", "add"]
_DEFAULT_BLEND: Blend = "mix"


@dataclass(frozen=True)
class PyramidSpec:
    """A choice of the quantity that an octree node averages, and of the precision in which the average is stored."""

    average: Annotated[
        Literal["extinction", "opacity"],
        schema.KeyText("The quantity that is averaged: `extinction`, or `opacity` as in the paper."),
    ] = "extinction"
    precision: Annotated[
        Literal["half", "single"],
        schema.KeyText("The type of averages: `half` is float16, `single` float32."),
    ] = "half"


def _parse_version(node: schema.TreeNode) -> Any:
    is_known = schema.parse_whole_number(node.value) == VERSION
    return VERSION if is_known else node.reject("unknown version of the scene format")


_VERSION = schema.FieldType(
    str(VERSION), _parse_version, plain_schema=lambda _moves: {"const": VERSION}, example=str(VERSION)
)


# The keys of a scene. A scene has `volume`, or else `volumes`; a volume has `transfer_function`, or else `labels`.
_DESCRIBED: schema.FieldTable = {
    "volume": schema.described(VOLUME_SECTION, "The voxels that are drawn, from `file`, `raw` or `procedural`."),
    "transfer_function": schema.described(
        TRANSFER_FUNCTION_SECTION,
        "The colors and opacities of the values: by `points`, by `colormap`, `range` and `opacity`, or by `import`.",
    ),
    "labels": schema.described(
        LABELS_FIELD,
        "In place of `transfer_function`: the labels of a segmentation, and their colors.",
        example="{show: [3, thalamus]}",
    ),
    "camera": schema.described(CAMERA_FIELD, "The camera and its path."),
    "output": schema.described(
        OUTPUT_SECTION,
        "The file of the film, or a list of its files.",
        example="{file: scan.mp4, size: [1024, 1024]}",
    ),
    "error": schema.described(ERROR_SECTION, "How exact the film is.", words=f"tolerance: {ErrorSpec.tolerance}"),
    "splat": schema.described(
        SPLAT_SECTION,
        "The primitives that are drawn.",
        words="footprint: integrated, which draws bricks",
        example="{footprint: gaussian, sigma: 0.425}",
    ),
    "pyramid": schema.described(
        schema.dataclass_field(PyramidSpec),
        "The averages of voxels that larger cells have.",
        words=f"average: {PyramidSpec.average}, precision: {PyramidSpec.precision}",
    ),
    "shading": schema.described(schema.dataclass_field(ShadingSpec), "A light on surfaces.", words="even light"),
    "light": schema.described(
        schema.dataclass_field(LightSpec),
        "In place of `shading`: surroundings and a lamp, whose light matter scatters.",
        words="no such light",
    ),
    "fog": schema.described(
        schema.dataclass_field(FogSpec), "Matter takes on the fog's color with depth.", words="no fog"
    ),
    "mode": schema.described(
        MODE_SECTION, "How a ray makes a color of the values that it passes.", default=ModeSpec.type
    ),
    "clip": schema.described(
        CLIP_SECTION, f"Planes and boxes that clip parts away, at most {MAX_CLIPS}.", words="none"
    ),
    "mask": schema.described(
        MASK_SECTION,
        "The labels within which a volume is shown: the keys of `volume` or `name`, and these.",
        words="the volume is shown everywhere",
    ),
    "volumes": schema.described(
        VOLUMES_SECTION,
        "In place of `volume` and `transfer_function`: several volumes, each with the keys of `volume` and these.",
        example='[{file: scan.nhdr, color: "#ff8000", range: [100, 2000]}]',
    ),
    "blend": schema.described(
        schema.choice_field(*get_args(Blend)),
        "How volumes are mixed. `mix`: extinctions add up. `add`: light adds up, unabsorbed.",
        default=_DEFAULT_BLEND,
    ),
    "annotation": schema.described(
        ANNOTATION_SECTION,
        "Texts, bars and lines. `layout`: in room beside the object, or over it.",
        words="none",
    ),
    "version": schema.described(_VERSION, "The version of the scene format.", default=VERSION),
}
_NEEDED = ("camera", "output")
SECTIONS: schema.FieldTable = {key: replace(field, is_needed=key in _NEEDED) for key, field in _DESCRIBED.items()}
# The sections that take the place of each other.
SECTION_ALTERNATIVES = schema.Alternatives(
    [("volume", "volumes"), ("transfer_function", "labels", "volumes"), ("shading", "light")], [("volume", "volumes")]
)

U = TypeVar("U")
AnyScene = TypeVar("AnyScene", bound="FilmScene")


class FilmScene(ABC):
    """A scene over all frames of its film. It offers the sections that cannot move; `at` returns all at one frame.

    A `Scene` is the scene of a film in which nothing moves. Backgrounds in `output` may move, as their type says. So
    may the tolerance or the budget in `error`, which is a schedule of the whole film, also in a `Scene`.
    """

    output: OutputSpec
    error: ErrorSpec
    blend: Blend

    @property
    @abstractmethod
    def _sections(self) -> Scene:
        """Return all sections, with a motion in the place of each value that moves."""

    def at(self, frame: int) -> Scene:
        """Return the scene at a frame, with plain values; this scene itself if nothing moves."""
        return replace(values_at(self._sections, frame), error=self.error)

    def changed(self: AnyScene, edit: Callable[..., Scene], *others: FilmScene) -> AnyScene:
        """Return a scene with other sections.

        edit: a function that takes the sections of this scene, and then those of each of `others`. It returns the
            sections of this scene, some of them replaced. It must not calculate with values, as they may be motions.
        """
        sections = edit(self._sections, *(other._sections for other in others))
        changed: Any = film_scene(sections)
        return changed  # type: ignore[no-any-return]

    @property
    def moves(self) -> bool:
        """Return whether anything but the tolerance moves."""
        return not _has_plain_sections(self._sections)

    @property
    def key_frames(self) -> list[int]:
        """Return the frames at which something that moves has a key, ascending."""
        return self.map(lambda scene: scene).key_frames

    @property
    def num_frames(self) -> int:
        """Return the number of frames of the film."""
        return self._sections.camera.num_frames

    def map(self, function: Callable[[Scene], U]) -> OverFrames[U]:
        """Return a part of the scene over all frames, which a function picks, as `OverFrames.map` does."""
        return OverFrames(function(self._sections))

    @property
    def film_layers(self) -> tuple[OverFrames[LayerSpec], ...]:
        """Return the layers of the film scene, whose values may move: each can be read at a frame."""
        return tuple(map(OverFrames, self._sections.layers))

    @property
    def has_list(self) -> bool:
        """Return whether the text of the scene has a list of volumes."""
        return self._sections.shared is not None

    def layer_key(self, number: int, key: str) -> str:
        """Return the dotted path, in the text of the scene, of a key of a layer."""
        layer, shared = self._sections.layers[number], self._sections.shared
        if shared is None:
            return f"volume.{key}" if key in VOLUME_TABLE else key
        is_shared = hasattr(shared, key) and getattr(shared, key) == getattr(layer, key)
        return key if is_shared else f"volumes.{number}.{key}"

    @property
    def is_projection(self) -> bool:
        """Return whether the mode is a projection, in which each ray shows one number and opacities do not count."""
        return self._sections.mode.is_projection

    @property
    def draw_order(self) -> str:
        """Return the order in which splats are drawn: `depth`, `unmixed` or `boxes`."""
        return self._sections.splat.order

    @property
    def primitive_name(self) -> str:
        """Return the name of what is drawn for a cell, in the singular, for messages."""
        return self._sections.splat.primitive_name

    @property
    def needs_opengl(self) -> bool:
        """Return whether the scene is drawn as splats, which need OpenGL. Bricks do not: kernels draw them."""
        return self._sections.splat.footprint != "integrated"

    @property
    def level_notes(self) -> list[str]:
        """Return sentences on the levels of stores that were chosen, one for each store."""
        chosen = (layer.volume.chosen for layer in self._sections.layers)
        return list(dict.fromkeys(each.note for each in chosen if each is not None))

    @property
    def import_notes(self) -> list[str]:
        """Return sentences on the features of imported transfer functions that are not drawn."""
        notes = []
        for layer in self._sections.layers:
            imported = layer.transfer_function.imported
            if imported is None:
                continue
            notes += [f"{imported.name}: not imported: {clause}" for clause in imported.left_out]
            if imported.shading and layer.shading is None and self._sections.light is None:
                flow = ", ".join(f"{key}: {format_value(value)}" for key, value in imported.shading.items())
                notes.append(f"{imported.name}: to be lit as there, add shading: {{{flow}}}")
        return notes


def _has_plain_sections(sections: Scene) -> bool:
    return is_plain(*(getattr(sections, each.name) for each in fields(sections) if each.name != "error"))


def film_scene(sections: Scene) -> FilmScene:
    """Return a scene of the given sections, in which motions may take the place of values."""
    return sections if _has_plain_sections(sections) else _MovingScene(sections)


@dataclass(frozen=True, init=False)
class _MovingScene(FilmScene):
    """A scene in which something moves."""

    _in_motion: Scene

    def __init__(self, _in_motion: Scene, **changes: Any) -> None:
        """Make a scene of sections, with changes to some. `dataclasses.replace` calls it with the changes, too."""
        sections = replace(_in_motion, **changes)
        object.__setattr__(self, "_in_motion", sections)
        for key in ("output", "error", "blend"):
            object.__setattr__(self, key, getattr(sections, key))

    @property
    def _sections(self) -> Scene:
        return self._in_motion


@dataclass(frozen=True)
class Scene(FilmScene):
    """A complete job with plain values: a film in which nothing moves, or one frame of a film in which something moves.

    Attributes
    ----------
    layers
        The volumes that are drawn.
    shared
        The shading and the mask that the text of the scene gives to all volumes of its list, and that the layers have
        already. None if the text has one volume and no list.
    """

    layers: tuple[LayerSpec, ...]
    camera: CameraSpec
    output: OutputSpec
    error: ErrorSpec = field(default=ErrorSpec())
    splat: SplatSpec = field(default=SplatSpec("integrated"))
    pyramid: PyramidSpec = PyramidSpec()
    light: LightSpec | None = None
    fog: FogSpec | None = None
    mode: ModeSpec = field(default=ModeSpec())
    clip: tuple[ClipSpec, ...] = ()
    blend: Blend = _DEFAULT_BLEND
    annotation: AnnotationSpec = field(default=AnnotationSpec())
    shared: SharedKeys | None = None

    def with_layers(self, **changes: Any) -> Scene:
        """Return the scene with the given values in fields of all its layers. changes: values by names of fields."""
        return replace(self, layers=tuple(replace(layer, **changes) for layer in self.layers))

    def shading_of(self, layer: LayerSpec) -> ShadingSpec | None:
        """Return the shading of a layer; in a scene with `light`, the shading by which its surfaces are found."""
        if self.light is None:
            return layer.shading
        return None if self.light.surfaces is None else self.light.surfaces.shading

    def written(self) -> dict[str, object]:
        """Return the sections of the scene by their keys."""
        found = {**vars(self), **self._written_layers()}
        return {"version": VERSION} | {key: found[key] for key in SECTIONS if key in found}

    def _written_layers(self) -> dict[str, object]:
        """Return the keys of the volumes, or of the list of volumes, with their values."""
        if self.shared is not None:
            return {**vars(self.shared), "volumes": tuple(map(self.shared.taken_from, self.layers))}
        (layer,) = self.layers
        own: dict[str, object] = {"volume": layer.volume, **layer.look, "shading": layer.shading, "mask": layer.mask}
        return own if layer.volume.component == "all" else own | {"blend": None}

    @property
    def _sections(self) -> Scene:
        return self

    def at(self, frame: int) -> Scene:
        """Return this scene, whichever frame is asked for, as nothing in it moves."""
        return self

    @property
    def background(self) -> Background:
        """Return the background of the scene's first output."""
        return self.output.background_at(0)

    @property
    def key_for_bricks(self) -> str | None:
        """Return a key of the scene that only bricks can show; None if splats can show all keys."""
        first = self.layers[0]
        asks = {
            "mode": self.mode.is_projection,
            "light": self.light is not None,
            "fog": self.fog is not None,
            "clip": bool(self.clip),
            "labels": first.transfer_function.labels is not None,
            "volumes": self.has_list,
            "shading": first.shading is not None and bool(first.shading.keys_for_bricks),
        }
        return next((key for key, is_asked in asks.items() if is_asked), None)
