"""The frozen description of a job: the content of `scene.yaml` with every default filled in.

Each large section of a scene has its own module (`volume_section`, `transfer_section`, `camera_section`,
`error_section`, `splat_section`, `output_section`) with its dataclass: for each key the type that checks it, and its
default. Nothing here imports numpy or OpenGL, so that `hsplat check` answers at once. Lengths are in world units (those
of the volume's spacing), angles in degrees, colours in [0, 1] as given (display-referred), shapes, points and sizes in
(x, y, z) and (width, height) order.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, is_dataclass
from typing import Annotated, Any, Literal, get_args, get_type_hints

from renderer.scene import schema
from renderer.scene.camera_section import CAMERA_SECTION, CameraSpec, direction_field
from renderer.scene.error_section import ERROR_SECTION, ErrorSpec
from renderer.scene.output_section import OUTPUT_SECTION, OutputSpec
from renderer.scene.splat_section import SPLAT_SECTION, SplatSpec
from renderer.scene.transfer_section import TRANSFER_FUNCTION_SECTION, TransferSpec
from renderer.scene.volume_section import VOLUME_SECTION, VolumeSpec

VERSION = 1


def _parse_version(node: schema.TreeNode) -> Any:
    is_known = schema.parse_whole_number(node.value) == VERSION
    return VERSION if is_known else node.reject("unknown version of the scene format")


_VERSION = schema.FieldType(str(VERSION), _parse_version)
_LIGHT = direction_field("[x, y, z], not all 0: from the object to the light")
Fraction = Annotated[float, schema.number_field(minimum=0, maximum=1)]


@dataclass(frozen=True)
class ShadingSpec:
    """View-independent Lambert shading; `light` points from the object to the light, in world axes."""

    ambient: Fraction = 0.3
    diffuse: Fraction = 0.7
    light: Annotated[schema.Vector, _LIGHT] = (1.0, -1.0, 1.0)


@dataclass(frozen=True)
class PyramidSpec:
    """What a node averages, and in which precision it is stored."""

    average: Literal["extinction", "opacity"] = "extinction"
    precision: Literal["half", "single"] = "half"


@dataclass(frozen=True)
class Scene:
    """One job, complete. With `overlay`, the edges of the drawn cells are drawn over the picture."""

    volume: Annotated[VolumeSpec, VOLUME_SECTION]
    transfer_function: Annotated[TransferSpec, TRANSFER_FUNCTION_SECTION]
    camera: Annotated[CameraSpec, CAMERA_SECTION]
    output: Annotated[OutputSpec, OUTPUT_SECTION]
    error: Annotated[ErrorSpec, ERROR_SECTION] = field(default=ErrorSpec())
    splat: Annotated[SplatSpec, SPLAT_SECTION] = field(default=SplatSpec("integrated"))
    pyramid: Annotated[PyramidSpec, schema.dataclass_field(PyramidSpec)] = PyramidSpec()
    shading: Annotated[ShadingSpec | None, schema.dataclass_field(ShadingSpec)] = None
    overlay: Literal["none", "octree"] = "none"
    version: Annotated[int, _VERSION] = VERSION

    @property
    def needs_opengl(self) -> bool:
        """Whether it has splats or lines; bricks are drawn without OpenGL, too."""
        return self.splat.footprint != "integrated" or self.overlay != "none"


def spec_types(cls: type[Any] = Scene) -> Iterator[type[Any]]:
    """Yield the dataclasses that a scene is made of, for sending scenes to other processes."""
    pending: list[Any] = [cls]
    while pending:
        hint = pending.pop()
        pending += get_args(hint)
        if isinstance(hint, type) and is_dataclass(hint):
            yield hint
            pending += get_type_hints(hint).values()
