"""Find the fields of OME's XML that change how the voxels of a TIFF file are understood, but are not applied."""

from __future__ import annotations

from collections.abc import Iterator

from renderer.readers.statements import FormatTable, Statement
from renderer.readers.tiff_description import is_ome, ome_elements
from renderer.system import attribute, number_in

STATEMENTS = FormatTable(
    "OME-TIFF",
    (
        Statement("PhysicalSizeX", "place", "the distance of pixels, and its unit; also of Y and Z"),
        Statement("DimensionOrder", "values", "the order of slices, channels and times"),
        Statement("SizeC", "meaning", "the number of channels; also SizeZ and SizeT"),
        Statement("TiffData", "values", "the page of each plane"),
        Statement("TimeIncrement", "meaning", "the time between two steps, and its unit"),
        Statement("DeltaT", "meaning", "the time of each plane, and its unit"),
        Statement("Name", "meaning", "the names of channels"),
        Statement("Color", "meaning", "the colours of channels"),
        Statement("PositionX", "place", "the position of the stage; also PositionY and PositionZ", is_applied=False),
        Statement("ModuloAlongZ", "meaning", "another axis along z, such as angles", is_applied=False),
        Statement("ModuloAlongC", "meaning", "another axis along channels, such as lifetimes", is_applied=False),
        Statement("ModuloAlongT", "meaning", "another axis along times, such as lifetimes", is_applied=False),
    ),
)


def note_of(description: str) -> str | None:
    """Return the note on fields of OME that are not applied, or None. description: the text in the first page."""
    return STATEMENTS.note(set(_unapplied(description))) if is_ome(description) else None


def _unapplied(description: str) -> Iterator[str]:
    first = next(iter(ome_elements(description, "Plane")), "")
    if any(number_in(attribute(first, f"Position{axis}") or "0") != 0 for axis in "XYZ"):
        yield "PositionX"
    yield from (name for name in ("ModuloAlongZ", "ModuloAlongC", "ModuloAlongT") if f"<{name}" in description)
