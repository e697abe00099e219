"""Recognise the units of a volume's lengths and values, and hold them with the directions of its world's axes."""

from __future__ import annotations

import math
import unicodedata
from collections.abc import Sequence
from typing import NamedTuple

from renderer.scene import is_unit

# The word for each prefix of the metre, by the symbol of the prefix.
_PREFIXES = {"": "", "n": "nano", "µ": "micro", "m": "milli", "c": "centi", "k": "kilo"}
# The unit of length as it is shown, by each spelling of the unit in files.
_SPELLINGS = {
    f"{word}met{end}": f"{prefix}m" for prefix, word in _PREFIXES.items() for end in ("er", "ers", "re", "res")
}
_OTHERS = {"µm": "µm um micron microns", "Å": "å angstrom angstroms", "inch": "in inch inches"}
_SPELLINGS |= {text: unit for unit, texts in _OTHERS.items() for text in texts.split()}
_SPELLINGS |= dict.fromkeys(("pixel", "pixels", "voxel", "voxels"), "")
_SPELLINGS = {unicodedata.normalize("NFKC", text): unit for text, unit in _SPELLINGS.items()}

# The numbers of pixels per inch that programs write for screens and printers, or if they know no resolution. They say
# nothing about the size of a voxel.
_NO_SIZES = (1, 72, 96, 300)


class Units(NamedTuple):
    """A record of the units that a file states; an empty text stands for an unknown unit.

    length_unit: the unit of lengths in the world. world_axes: `LPS` if x, y and z of the world point to the left of a
    body, to its back and up; else an empty text. value_unit: the unit of the values.
    """

    length_unit: str = ""
    world_axes: str = ""
    value_unit: str = ""


def units_of(length: str = "", axes: str = "", value: str = "") -> Units:
    """Return the units that the texts stand for; a text that stands for no unit, or is too long, becomes empty."""
    length, value = one_spelling(length), value.strip()
    return Units(length * is_unit(length), "LPS" if axes == "LPS" else "", value * is_unit(value))


def are_of_screen(per_inch: Sequence[float]) -> bool:
    """Return whether all numbers of pixels per inch, at least one, are usual ones of screens and printers."""
    return bool(per_inch) and all(any(math.isclose(n, k, rel_tol=2e-3) for k in _NO_SIZES) for n in per_inch)


def one_spelling(unit: str) -> str:
    """Return a unit of length in the spelling that is shown, an empty text for pixels, and other units unchanged."""
    text = unicodedata.normalize("NFKC", unit.strip())
    return _SPELLINGS.get(text.lower(), text)
