"""Colour look-up tables of MRIcroGL, .clut: INI text with nodes at intensities from 0 to 255, and their range.

Opacities are for a voxel along the ray.
"""

from __future__ import annotations

import configparser

from renderer.looks.look import Look
from renderer.looks.look_file import LookFile
from renderer.looks.tables import table_look


def read(file: LookFile) -> Look:
    """Return the table in a file."""
    parser = configparser.RawConfigParser()
    try:
        parser.read_string(file.text())
    except configparser.Error as error:
        raise file.error("not text of [sections] and key=value", getattr(error, "lineno", None)) from error

    def value(section: str, key: str) -> str:
        if not parser.has_option(section, key):
            raise file.error(f"no {key}", f"[{section}]")
        return parser.get(section, key)

    num_nodes = file.number(value("INT", "numnodes"), "numnodes", 1, 256)
    rows = []
    for k in range(int(num_nodes)):
        parts = value("RGBA255", f"nodergba{k}").split("|")
        if len(parts) != 4:
            raise file.error("not a colour", f"nodergba{k}", got="|".join(parts), expected="red|green|blue|alpha")
        rows.append((value("BYT", f"nodeintensity{k}"), *parts))
    return table_look(file, rows, value("FLT", "min"), value("FLT", "max"))
