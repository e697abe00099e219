"""Import transfer functions of Inviwo, .itf: XML with points, at shares of the data's range or at values.

Opacities are for a length of 1/150 of the volume's width, and linear between points.
"""

from __future__ import annotations

from renderer.looks.look import Look
from renderer.looks.look_file import LookFile

_UNIT_NOTE = "the unit of opacities, 1/150 of the volume's width: without a unit in the scene they are for a voxel"
# The values of the element `type` that say that points are shares of the data's range.
_RELATIVE = ("0", "relative")


def read(file: LookFile) -> Look:
    """Return the transfer function in a file."""
    root, rows = file.xml(), list[tuple[object, ...]]()
    kind = root.find("type")
    is_share = kind is None or kind.get("content", "0").lower() in _RELATIVE
    for number, point in enumerate(file.child(root, "Points", "points", "dataPoints"), start=1):
        place, color = file.child(point, "pos"), file.child(point, "rgba")
        rows.append((f"point {number}", place.get("content", place.get("x")), *map(color.get, "xyzw")))
    ends = [element.get("content") for tag in ("maskMin", "maskMax") if (element := root.find(tag)) is not None]
    is_masked = is_share and [file.number(end, "the mask") for end in ends] not in ([], [0.0, 1.0])
    return Look(file.curve(rows, 4), is_share=is_share, left_out=(_UNIT_NOTE, *["its mask"] * is_masked))
