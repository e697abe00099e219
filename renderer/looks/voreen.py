"""Import transfer functions of Voreen, .tfi: XML with keys at intensities, which are shares of a domain.

Opacities are for a length of 1/200 of the volume's width, and linear between keys.
"""

from __future__ import annotations

from xml.etree.ElementTree import Element

from renderer.looks.look import Look
from renderer.looks.look_file import LookFile

_UNIT_NOTE = "the unit of opacities, 1/200 of the volume's width: without a unit in the scene they are for a voxel"
# The XML elements that are not imported, each with its name, its attributes, the values with which it has no effect,
# and the words by which a note names it. `lower` and `upper` are thresholds of older files.
_LEFT_OUT = (
    ("threshold", "xy", [0.0, 1.0], "its threshold"),
    ("lower", ["value"], [0.0], "its lower threshold"),
    ("upper", ["value"], [1.0], "its upper threshold"),
    ("gammaValue", ["value"], [1.0], "its gamma"),
    ("alphaMode", ["value"], [1.0], "its alpha mode"),
)


def read(file: LookFile) -> Look:
    """Return the transfer function in a file."""
    root = file.child(file.xml(), "TransFuncIntensity")
    low, high = _numbers(file, root, "domain", "xy") or [0.0, 1.0]
    rows = list[tuple[object, ...]]()
    for number, key in enumerate(file.child(root, "Keys"), start=1):
        at = f"key {number}"
        share = file.number(file.child(key, "intensity").get("value"), at, 0.0, 1.0)
        is_split = file.child(key, "split").get("value") == "true"
        for side in ("colorL", "colorR") if is_split else ("colorL",):
            rows.append((at, low + share * (high - low), *map(file.child(key, side).get, "rgba")))
    notes = [note for tag, names, usual, note in _LEFT_OUT if _numbers(file, root, tag, names) not in (None, usual)]
    return Look(file.curve(rows, 4, 255.0), (low, high) == (0, 1), (low, high), left_out=(_UNIT_NOTE, *notes))


def _numbers(file: LookFile, root: Element, tag: str, names: str | list[str]) -> list[float] | None:
    """Return the numbers in the attributes `names` of the child element `tag`; None without such a child."""
    found = root.find(tag)
    return None if found is None else [file.number(found.get(name), f"<{tag}>") for name in names]
