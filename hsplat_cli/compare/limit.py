"""Define the one limit of a comparison: the largest difference between a golden and a drawn picture that passes.

- `same bytes`: no stored value differs.
- `stated accuracy`: both pictures may be right. Each states its accuracy, a PSNR against the exact picture; the
  difference of two pictures is at most the sum of their errors (the triangle inequality of the root mean square). The
  new picture counts as no less accurate than its golden: a fault of drawing lowers the accuracy that it states, too.
- a number of decibels: no part of the picture, a window of PART_PX x PART_PX pixels, has a lower PSNR.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any, Literal

from hsplat_cli.compare.difference import PART_PX, Figures
from renderer.accuracy import MOST_DB, psnr, squared_error
from renderer.scene import schema

Kind = Literal["same bytes", "stated accuracy", "decibels"]

# The PSNR that a golden and a new picture state, in dB; None for one that states none.
Stated = tuple[float | None, float | None]
NOT_STATED: Stated = (None, None)

_DECIBELS = re.compile(r"([0-9]{1,3}(?:\.[0-9]{1,3})?) *(?:dB)?", re.IGNORECASE)
_EXPECTED = "`same bytes`, `stated accuracy`, or decibels, such as 45 dB"


@dataclass(frozen=True)
class Limit:
    """A limit of the difference between two pictures.

    decibels: the lowest PSNR of a part that passes; None for the other kinds.
    """

    kind: Kind
    decibels: float | None = None

    def __str__(self) -> str:
        """Return the limit as scenes and options spell it."""
        return self.kind if self.decibels is None else f"{self.decibels:g} dB"

    @property
    def words(self) -> str:
        """Return what the limit allows, for people."""
        if self.decibels is not None:
            return f"no part of {PART_PX} x {PART_PX} pixels below {self.decibels:g} dB"
        if self.kind == "stated accuracy":
            return "no more difference than the stated accuracies allow"
        return "the same stored values"

    def least_psnr(self, stated: Stated = NOT_STATED) -> float:
        """Return the lowest PSNR that passes: of the whole picture by the stated accuracy, else of a part.

        Where an accuracy is not stated, only equal pictures pass by it.
        """
        if self.decibels is not None:
            return self.decibels
        old, new = stated
        if self.kind == "same bytes" or old is None or new is None:
            return MOST_DB
        error_of_golden, error_of_new = squared_error(old) ** 0.5, squared_error(new) ** 0.5
        return psnr((error_of_golden + min(error_of_golden, error_of_new)) ** 2)

    def passes(self, figures: Figures, stated: Stated = NOT_STATED) -> bool:
        """Return whether a difference passes."""
        found = figures.psnr if self.kind == "stated accuracy" else figures.part_psnr
        return figures.is_same or (self.kind != "same bytes" and found >= self.least_psnr(stated))


SAME_BYTES = Limit("same bytes")
# The mistake of another limit of golden digests, and its remedy.
LIMIT_OF_DIGESTS = "digests have no limit but `same bytes`"
HINT_FOR_DIGESTS = "leave the limit out, or keep pictures by `pictures: files`"


def _parse(node: schema.TreeNode) -> Any:
    value = node.value
    text = f"{value:g}" if type(value) in (int, float) else value
    if not isinstance(text, str):
        return node.reject("not a limit")
    if text.strip().lower() in ("same bytes", "stated accuracy"):
        return Limit("same bytes" if text.strip().lower() == "same bytes" else "stated accuracy")
    found = _DECIBELS.fullmatch(text.strip())
    if found is None:
        return node.reject("not a limit")
    decibels = float(found[1])
    return Limit("decibels", decibels) if 0 < decibels <= MOST_DB else node.reject("out of range")


LIMIT_FIELD: schema.FieldType[Limit] = schema.FieldType(_EXPECTED, _parse)
