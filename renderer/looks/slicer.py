"""Import volume properties of 3D Slicer: presets in XML, the older text of a .vp file, and the newer .vp.json.

3D Slicer draws with VTK: opacities are for a length in the world, `ScalarOpacityUnitDistance`, and linear between
points.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

from renderer.looks.curves import merge_curves
from renderer.looks.look import Look, Looks
from renderer.looks.look_file import LookFile

# The points of a curve of colours or opacities: each has its place in the file (for messages), a value, and a colour or
# an opacity.
_Rows = list[tuple[Any, ...]]

# The length in the world that opacities refer to if a file states none: VTK's default of ScalarOpacityUnitDistance.
_UNIT = 1.0
# The parameters of the light that a file does not state: VTK's defaults.
_LIGHT = {"ambient": 0.1, "diffuse": 0.7, "specular": 0.2, "specularPower": 10.0}
# The factor from Phong's shininess in VTK to Blinn's in hsplat, for narrow highlights of the same width.
_BLINN_PER_PHONG = 4.0
# The largest shininess of a scene.
_MAX_SHININESS = 1000.0
# The content of each line of a .vp file.
_LINES = ("interpolation", "shade", "diffuse", "ambient", "specular", "specularPower",
          "scalarOpacity", "gradientOpacity", "colorTransfer")  # fmt: skip
_GRADIENT_NOTE = "opacities by the gradient (shading.gradient_opacity has factors on extinctions)"


def read_xml(file: LookFile) -> Looks:
    """Return the presets in a file of elements `<VolumeProperty name="CT-Bone" scalarOpacity="..." .../>`."""
    found = [element for element in file.xml().iter() if element.tag.startswith("VolumeProperty")]
    if not found:
        raise file.error("no volume properties", expected='elements <VolumeProperty name="..." colorTransfer="...">')
    return {element.get("name", ""): partial(_from_texts, file, element.attrib) for element in found}


def read_text(file: LookFile) -> Look:
    """Return the volume property in a file of nine lines; some lines may be empty."""
    lines = file.text().splitlines()
    if len(lines) < len(_LINES):
        raise file.error("too few lines", got=f"{len(lines)} lines", expected=f"{len(_LINES)}: {', '.join(_LINES)}")
    return _from_texts(file, dict(zip(_LINES, lines, strict=False)))


def _from_texts(file: LookFile, texts: Mapping[str, str]) -> Look:
    """Return the look that the texts of a volume property describe.

    texts: the text of each attribute. The text of a function is the count of its numbers, followed by the numbers.
    """

    def rows(key: str, size: int) -> _Rows:
        at = f"{texts.get('name', '')} {key}".strip()
        count, *numbers = texts.get(key, "").split() or ["0"]
        if file.number(count, at) != len(numbers):
            raise file.error("not as many numbers as it says", at, got=f"{count} and {len(numbers)} numbers",
                             expected="their number, and the numbers")  # fmt: skip
        return [(at, *row) for row in file.groups(numbers, at, size)] if numbers else []

    light = {key: text for key, text in texts.items() if text}
    is_lit = file.number(texts.get("shade") or 0, "shade") != 0
    functions = rows("colorTransfer", 4), rows("scalarOpacity", 2), rows("gradientOpacity", 2)
    return _look(file, functions, light if is_lit else None)


def read_json(file: LookFile) -> Look:
    """Return the look of a .vp.json file: the first component of the first volume property, as in 3D Slicer."""
    properties = file.member(file.json(), "volumeProperties", list, "the file")
    components = file.member((properties or [None])[0], "components", list, "volumeProperties")
    component, notes = (components or [None])[0], list[str]()

    def rows(key: str, name: str) -> _Rows:
        points = file.member(file.member(component, key, dict, "components"), "points", list, key)
        trees = [point if isinstance(point, dict) else {} for point in points]
        if any(tree.get("midpoint", 0.5) != 0.5 or tree.get("sharpness", 0) != 0 for tree in trees):
            notes.append(f"midpoints and sharpness of {key}")
        parts = [tree.get(name) for tree in trees]
        return [(key, tree.get("x"), *(part if isinstance(part, list) else [part]))
                for tree, part in zip(trees, parts, strict=True)]  # fmt: skip

    colors, opacities = rows("rgbTransferFunction", "color"), rows("scalarOpacity", "y")
    has_gradient = "gradientOpacity" in component and component.get("disableGradientOpacity") is not True
    gradient = rows("gradientOpacity", "y") if has_gradient else []
    light = file.member({"lighting": {}, **component}, "lighting", dict, "components")
    unit = file.number(component.get("scalarOpacityUnitDistance", _UNIT), "scalarOpacityUnitDistance", 1e-30, 1e30)
    notes += ["other components"] * (len(components) > 1)
    functions = colors, opacities, gradient
    return _look(file, functions, light if component.get("shade") is True else None, unit, notes)


def _look(
    file: LookFile, functions: Sequence[_Rows], light: Any, unit: float = _UNIT, left_out: Sequence[str] = ()
) -> Look:
    """Return a look from the functions and the light of a volume property.

    functions: the points of colours, of opacities, and of opacities by the gradient. light: the parameters of the
    light, or None. unit: the world length that opacities refer to. left_out: clauses on features that hsplat lacks.
    """
    colors, opacities, gradient = functions
    shading: dict[str, Any] = {}
    if light is not None:
        given = {key: file.number(value, key, 0.0, 1e6) for key, value in {**_LIGHT, **light}.items() if key in _LIGHT}
        power = _BLINN_PER_PHONG * given.pop("specularPower")
        shading = {"light": "camera", "two_sided": True, **{key: min(part, 1.0) for key, part in given.items()},
                   "shininess": min(max(power, 1.0), _MAX_SHININESS)}  # fmt: skip
    if gradient and min(part for _, (part,) in file.curve(gradient, 1)) < 1:
        left_out = [*left_out, _GRADIENT_NOTE]
    curve = merge_curves(file.curve(colors, 3), file.curve(opacities, 1))
    return Look(curve, unit=unit, shading=shading, left_out=tuple(left_out))
