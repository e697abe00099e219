"""The units of a volume's lengths and values, and what the axes of its world point to, as far as its file says."""

from __future__ import annotations

import math
import unicodedata
from collections.abc import Sequence
from typing import NamedTuple

from renderer.scene import is_unit

# Units of length in several spellings, by the one that is shown.
_PREFIXES = {"": "", "n": "nano", "µ": "micro", "m": "milli", "c": "centi", "k": "kilo"}
_SPELLINGS = {
    f"{word}met{end}": f"{prefix}m" for prefix, word in _PREFIXES.items() for end in ("er", "ers", "re", "res")
}
_OTHERS = {"µm": "µm um micron microns", "Å": "å angstrom angstroms", "inch": "in inch inches"}
_SPELLINGS |= {text: unit for unit, texts in _OTHERS.items() for text in texts.split()}
_SPELLINGS |= dict.fromkeys(("pixel", "pixels", "voxel", "voxels"), "")
_SPELLINGS = {unicodedata.normalize("NFKC", text): unit for text, unit in _SPELLINGS.items()}

# Pixels per inch that programs write for screens and printers, or for want of anything else.
_NO_SIZES = (1, 72, 96, 300)


class Units(NamedTuple):
    """A record of the units that a file states; an empty text where it states none.

    length_unit: of lengths in the world. world_axes: `LPS` where x, y and z of the world point to the left of a body,
    to its back and up. value_unit: of the values.
    """

    length_unit: str = ""
    world_axes: str = ""
    value_unit: str = ""


def units_of(length: str = "", axes: str = "", value: str = "") -> Units:
    """Return units by texts from outside; those that are none, or are too long, count as not said."""
    length, value = one_spelling(length), value.strip()
    return Units(length * is_unit(length), "LPS" if axes == "LPS" else "", value * is_unit(value))


def are_of_screen(per_inch: Sequence[float]) -> bool:
    """Return whether numbers of pixels per inch, at least one, are those of screens and printers, and no lengths."""
    return bool(per_inch) and all(any(math.isclose(n, k, rel_tol=2e-3) for k in _NO_SIZES) for n in per_inch)


def one_spelling(unit: str) -> str:
    """Return a unit of length in the spelling that is shown; empty for pixels; others as they are."""
    text = unicodedata.normalize("NFKC", unit.strip())
    return _SPELLINGS.get(text.lower(), text)
