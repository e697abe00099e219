"""Transfer functions of Voreen, .tfi: XML with keys by intensity, a share of a domain.

Opacities are for 1/200 of the volume's width, and linear between keys.
"""

from __future__ import annotations

from xml.etree.ElementTree import Element

from renderer.looks.look import Look
from renderer.looks.look_file import LookFile

_UNIT_NOTE = "the unit of opacities, 1/200 of the volume's width: without a unit in the scene they are for a voxel"
_USES_ALPHA = "1"


def read(file: LookFile) -> Look:
    """Return the transfer function in a file."""
    root = file.child(file.xml(), "TransFuncIntensity")
    domain, left_out = root.find("domain"), [_UNIT_NOTE]
    span = (0.0, 1.0) if domain is None else _pair(file, domain)
    curve: list[tuple[float, tuple[float, ...]]] = []
    for number, key in enumerate(file.child(root, "Keys"), start=1):
        at = f"key {number}"
        share = file.number(file.attribute(file.child(key, "intensity"), "value"), at, 0.0, 1.0)
        is_split = file.attribute(file.child(key, "split"), "value", "false") == "true"
        for side in ("colorL", "colorR") if is_split else ("colorL",):
            color = file.child(key, side)
            red, green, blue, alpha = (file.number(file.attribute(color, part), at, 0, 255) / 255 for part in "rgba")
            curve.append((span[0] + share * (span[1] - span[0]), (red, green, blue, alpha)))
    if not curve:
        raise file.error("no keys", "<Keys>")
    threshold, gamma, mode = (root.find(tag) for tag in ("threshold", "gammaValue", "alphaMode"))
    if threshold is not None and _pair(file, threshold) != (0.0, 1.0):
        left_out.append("its threshold")
    if gamma is not None and file.number(file.attribute(gamma, "value"), "gammaValue") != 1:
        left_out.append("its gamma")
    if mode is not None and mode.get("value") != _USES_ALPHA:
        left_out.append("its alpha mode")
    curve.sort(key=lambda point: point[0])
    return Look(curve, is_share=span == (0.0, 1.0), span=span, left_out=tuple(left_out))


def _pair(file: LookFile, element: Element) -> tuple[float, float]:
    x, y = (file.number(file.attribute(element, name), f"<{element.tag}>") for name in "xy")
    return x, y
