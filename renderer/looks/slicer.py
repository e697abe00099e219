"""Volume properties of 3D Slicer: presets in XML, the older text of a .vp file, and the newer .vp.json.

VTK draws them: opacities are for a world unit, `ScalarOpacityUnitDistance`, and linear between points.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

from renderer.looks.curves import Curve, merge_curves
from renderer.looks.look import Look, Looks
from renderer.looks.look_file import LookFile

_UNIT = 1.0
# Highlights of VTK are Phong's, hsplat's Blinn's, of which narrow ones are as wide with four times the shininess.
_BLINN_PER_PHONG, _MAX_SHININESS = 4.0, 1000.0
_LINES = ("interpolation", "shade", "diffuse", "ambient", "specular", "specularPower",
          "scalarOpacity", "gradientOpacity", "colorTransfer")  # fmt: skip


def read_xml(file: LookFile) -> Looks:
    """Return the presets in a file of elements `<VolumeProperty name="CT-Bone" scalarOpacity="..." .../>`."""
    found = [element for element in file.xml().iter() if element.tag.startswith("VolumeProperty")]
    if not found:
        raise file.error("no volume properties", expected='elements <VolumeProperty name="..." colorTransfer="...">')
    return {element.get("name", ""): partial(_from_texts, file, element.attrib) for element in found}


def read_text(file: LookFile) -> Look:
    """Return the volume property in nine lines."""
    lines = [line for _, line in file.lines()]
    if len(lines) < len(_LINES):
        raise file.error("too few lines", got=f"{len(lines)} lines", expected=f"{len(_LINES)}: {', '.join(_LINES)}")
    return _from_texts(file, dict(zip(_LINES, lines, strict=False)))


def _from_texts(file: LookFile, texts: Mapping[str, str]) -> Look:
    """Return the look of attributes: functions are the number of all numbers, and then the numbers."""

    def curve(key: str, group: int) -> Curve:
        at = f"{texts.get('name', '')} {key}".strip()
        count, *numbers = file.numbers(texts.get(key, "").split(), at)
        if count != len(numbers) or not numbers or len(numbers) % group:
            raise file.error("not as many numbers as it says", at, got=f"{count:g} and {len(numbers)} numbers",
                             expected=f"their number, a multiple of {group}, and the numbers")  # fmt: skip
        return _curve(file, numbers, group, at)

    light = {key: texts.get(key) for key in ("ambient", "diffuse", "specular", "specularPower")}
    gradient = curve("gradientOpacity", 2) if texts.get("gradientOpacity") else ()
    is_lit = file.number(texts.get("shade", "0"), "shade") != 0
    return _look(file, curve("colorTransfer", 4), curve("scalarOpacity", 2), gradient, light if is_lit else {})


def read_json(file: LookFile) -> Looks:
    """Return the volume properties of a .vp.json file, of which the first component counts."""
    properties = file.member(file.json(), "volumeProperties", list, "the file")
    names = {k: f"{k}" if len(properties) > 1 else "" for k in range(len(properties))}
    return {names[k]: partial(_from_json, file, each) for k, each in enumerate(properties)}


def _from_json(file: LookFile, tree: Any) -> Look:
    component = (file.member(tree, "components", list, "volumeProperties") or [None])[0]
    colors, color_notes = _json_curve(file, component, "rgbTransferFunction", "color")
    opacities, opacity_notes = _json_curve(file, component, "scalarOpacity", "y")
    has_gradient = "gradientOpacity" in component and component.get("disableGradientOpacity") is not True
    gradient = _json_curve(file, component, "gradientOpacity", "y")[0] if has_gradient else ()
    light = file.member(component, "lighting", dict, "components") if component.get("shade") is True else {}
    unit = file.number(component.get("scalarOpacityUnitDistance", _UNIT), "scalarOpacityUnitDistance", 1e-30, 1e30)
    return _look(file, colors, opacities, gradient, light, unit, [*color_notes, *opacity_notes])


def _json_curve(file: LookFile, component: Any, key: str, name: str) -> tuple[Curve, list[str]]:
    """Return a function of a component, and a note where it is not linear between points."""
    numbers, is_bent = list[object](), False
    for point in file.member(file.member(component, key, dict, "components"), "points", list, key):
        at = point if isinstance(point, dict) else {}
        parts = at.get(name)
        numbers += [at.get("x"), *(parts if isinstance(parts, list) and len(parts) == 3 else [parts])]
        is_bent |= at.get("midpoint", 0.5) != 0.5 or at.get("sharpness", 0) != 0
    group = 4 if name == "color" else 2
    return _curve(file, file.numbers(numbers, key, group), group, key), [f"midpoints and sharpness of {key}"] * is_bent


def _curve(file: LookFile, numbers: list[float], group: int, at: str) -> Curve:
    """Return a curve from numbers: a value, and a colour or an opacity, and again. VTK takes them by value."""
    points = []
    for k in range(0, len(numbers) - group + 1, group):
        value, *parts = numbers[k : k + group]
        points.append((value, tuple(file.number(part, at, 0.0, 1.0) for part in parts)))
    return sorted(points, key=lambda point: point[0])


def _look(
    file: LookFile,
    colors: Curve,
    opacities: Curve,
    gradient: Curve,
    light: Mapping[str, Any],
    unit: float = _UNIT,
    left_out: Any = (),
) -> Look:
    shading: dict[str, Any] = {}
    if light:
        given = {key: file.number(value, key, 0.0, 1e6) for key, value in light.items() if value is not None}
        names = ("ambient", "diffuse", "specular")
        shading = {"light": "camera", "two_sided": True, **{key: min(given[key], 1.0) for key in names if key in given}}
        power = _BLINN_PER_PHONG * given.get("specularPower", 1.0)
        shading |= {"shininess": min(max(power, 1.0), _MAX_SHININESS)}
    if any(factor < 1 for _, (factor,) in gradient):
        left_out = [*left_out, "opacities by the gradient (shading.gradient_opacity has factors on extinctions)"]
    return Look(merge_curves(colors, opacities), unit=unit, shading=shading, left_out=tuple(left_out))
