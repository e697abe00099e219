"""Import colour look-up tables of MRIcroGL, .clut: INI text with nodes at intensities from 0 to 255, and their range.

Opacities are for a length of a voxel along the ray.
"""

from __future__ import annotations

from renderer.looks.color_tables import table_look
from renderer.looks.look import Look
from renderer.looks.look_file import LookFile


def read(file: LookFile) -> Look:
    """Return the colour table in a file, as a look. All keys are different, so that INI sections can be ignored."""
    pairs = (text.lower().partition("=") for _, text in file.lines())
    values = {key.strip(): value for key, _, value in pairs}

    def value(key: str) -> str:
        return file.member(values, key, str, "the file")

    num_nodes = int(file.number(value("numnodes"), "numnodes", 1, 256))
    rows = [(f"node {k}", value(f"nodeintensity{k}"), *value(f"nodergba{k}").split("|")) for k in range(num_nodes)]
    return table_look(file, rows, value("min"), value("max"))
