"""The frozen description of a job: the content of `scene.yaml` with every default filled in.

Each large section of a scene has its own module (`volume_section`, `transfer_section`, `camera_section`,
`error_section`, `splat_section`, `shading_section`, `mode_section`, `clip_section`, `annotation_section`,
`output_section`) with its dataclass: for each key the type that checks it, and its default. Nothing here imports numpy
or OpenGL, so that `hsplat check` answers at once. Lengths are in world units (those of the volume's spacing), angles in
degrees, colours in [0, 1] as given (display-referred), shapes, points and sizes in (x, y, z) and (width, height) order.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from typing import Annotated, Any, Literal, TypeVar

from renderer.scene import schema
from renderer.scene.annotation_section import ANNOTATION_SECTION, AnnotationSpec
from renderer.scene.camera_section import CAMERA_FIELD, CameraSpec
from renderer.scene.clip_section import CLIP_SECTION, ClipSpec
from renderer.scene.error_section import ERROR_SECTION, ErrorSpec
from renderer.scene.labels_section import MASK_SECTION, MaskSpec
from renderer.scene.layers_section import VOLUMES_SECTION, LayerSpec
from renderer.scene.message_text import format_value
from renderer.scene.mode_section import MODE_SECTION, ModeSpec
from renderer.scene.motion import OverFrames, is_plain, values_at
from renderer.scene.output_section import OUTPUT_SECTION, Background, OutputSpec
from renderer.scene.shading_section import ShadingSpec
from renderer.scene.splat_section import SPLAT_SECTION, SplatSpec
from renderer.scene.transfer_section import TRANSFER_FUNCTION_SECTION, TransferSpec
from renderer.scene.volume_section import VOLUME_SECTION, VolumeSpec

VERSION = 1


def _parse_version(node: schema.TreeNode) -> Any:
    is_known = schema.parse_whole_number(node.value) == VERSION
    return VERSION if is_known else node.reject("unknown version of the scene format")


_VERSION = schema.FieldType(str(VERSION), _parse_version)


@dataclass(frozen=True)
class PyramidSpec:
    """A choice of what a node averages, and of the precision in which it is stored."""

    average: Literal["extinction", "opacity"] = "extinction"
    precision: Literal["half", "single"] = "half"


U = TypeVar("U")
AnyScene = TypeVar("AnyScene", bound="FilmScene")


class FilmScene(ABC):
    """A scene over all frames of its film. It has what cannot move; `at` a frame it is a `Scene`, which has all else.

    A `Scene` is the scene of a film in which nothing moves. Backgrounds in `output` may move, as their type says. So
    may the tolerance or the budget in `error`, which is a schedule of the whole film, also in a `Scene`.
    """

    output: OutputSpec
    error: ErrorSpec
    blend: Literal["mix", "add"]

    @property
    @abstractmethod
    def _sections(self) -> Scene:
        """Return all sections, with a motion in the place of each value that moves."""

    def at(self, frame: int) -> Scene:
        """Return the scene with plain values, as it is at a frame; itself if nothing moves."""
        return replace(values_at(self._sections, frame), error=self.error)

    def changed(self: AnyScene, edit: Callable[..., Scene], *others: FilmScene) -> AnyScene:
        """Return a scene with other sections.

        edit: takes a scene, and those of `others`, and returns the scene with something replaced in it. It may not
            calculate: values that it is given may be motions.
        """
        sections = edit(self._sections, *(other._sections for other in others))
        changed: Any = film_scene(sections)
        return changed  # type: ignore[no-any-return]

    @property
    def moves(self) -> bool:
        """Return whether anything but its tolerance moves."""
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
        """Return what a function picks from the scene, as `OverFrames.map` does."""
        return OverFrames(function(self._sections))

    @property
    def film_layers(self) -> tuple[OverFrames[LayerSpec], ...]:
        """Return what is drawn: the volumes, or the only one. Those without shading or mask have the scene's."""
        return tuple(map(OverFrames, self._sections.layers))

    @property
    def has_list(self) -> bool:
        """Return whether it has a list of volumes."""
        return bool(self._sections.volumes)

    @property
    def is_projection(self) -> bool:
        """Return whether a ray shows one number, and opacities do not count."""
        return self._sections.mode.is_projection

    @property
    def draw_order(self) -> str:
        """Return the order in which splats are drawn."""
        return self._sections.splat.order

    @property
    def primitive_name(self) -> str:
        """Return the name of what is drawn, in the singular, for messages."""
        return self._sections.splat.primitive_name

    @property
    def needs_opengl(self) -> bool:
        """Return whether it has splats; bricks are drawn by kernels."""
        return self._sections.splat.footprint != "integrated"

    @property
    def import_notes(self) -> list[str]:
        """Return sentences on what an imported transfer function has that is not drawn."""
        notes = []
        for layer in self._sections.layers:
            imported = layer.transfer_function.imported
            if imported is None:
                continue
            notes += [f"{imported.name}: not imported: {clause}" for clause in imported.left_out]
            if imported.shading and layer.shading is None:
                flow = ", ".join(f"{key}: {format_value(value)}" for key, value in imported.shading.items())
                notes.append(f"{imported.name}: to be lit as there, add shading: {{{flow}}}")
        return notes


def _has_plain_sections(sections: Scene) -> bool:
    return is_plain(*(getattr(sections, each.name) for each in fields(sections) if each.name != "error"))


def film_scene(sections: Scene) -> FilmScene:
    """Return a scene of these sections, in which motions may be in the places of values."""
    return sections if _has_plain_sections(sections) else _MovingScene(sections)


@dataclass(frozen=True, init=False)
class _MovingScene(FilmScene):
    """A scene in which something moves."""

    _in_motion: Scene

    def __init__(self, _in_motion: Scene, **changes: Any) -> None:
        """Make a scene of sections in which some are changed: of this, `dataclasses.replace` makes others, too."""
        sections = replace(_in_motion, **changes)
        object.__setattr__(self, "_in_motion", sections)
        for key in ("output", "error", "blend"):
            object.__setattr__(self, key, getattr(sections, key))

    @property
    def _sections(self) -> Scene:
        return self._in_motion


@dataclass(frozen=True)
class Scene(FilmScene):
    """A complete job with plain values: a film in which nothing moves, or one frame of another.

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

    @property
    def _sections(self) -> Scene:
        return self

    def at(self, frame: int) -> Scene:
        """Return the scene itself: nothing moves."""
        return self

    @property
    def background(self) -> Background:
        """Return the background of the first output."""
        return self.output.background_at(0)

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
