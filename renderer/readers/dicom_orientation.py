"""Find the directions of the rows and columns of a DICOM frame in the patient."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from renderer.readers.dicom_fields import Dataset, numbers_of, text_of
from renderer.volume import Float64

# The directions of a frame with rows along x and columns along y.
_ALONG_XY = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0]
# The direction, in LPS, that each letter of PatientOrientation stands for.
_LETTERS = {
    "L": [1.0, 0.0, 0.0],
    "R": [-1.0, 0.0, 0.0],
    "P": [0.0, 1.0, 0.0],
    "A": [0.0, -1.0, 0.0],
    "H": [0.0, 0.0, 1.0],
    "F": [0.0, 0.0, -1.0],
}
# The note on directions that only letters give.
_BY_LETTERS = "the file does not give directions as numbers; those of PatientOrientation are taken"


class Axes(NamedTuple):
    """The directions of the rows and columns of a frame, float64 [3] each.

    are_known: whether the file gives the directions. are_of_patient: whether they are in LPS. note: a remark, or None.
    """

    row: Float64
    column: Float64
    are_known: bool
    are_of_patient: bool
    note: str | None = None


def axes_of(fields: Sequence[Dataset]) -> Axes:
    """Return the directions of the rows and columns of a frame.

    They are in the patient, or, for ultrasound, in the space of the transducer. Numbers are preferred to letters.
    Without directions in the file, rows lie along x and columns along y. The axes of a quadruped are not LPS.
    """
    is_quadruped = text_of(fields, "AnatomicalOrientationType") == "QUADRUPED"
    in_patient, in_volume = (numbers_of(fields, f"ImageOrientation{space}") for space in ("Patient", "Volume"))
    if len(in_patient) == 6:
        return _axes(in_patient, are_of_patient=not is_quadruped)
    if len(in_volume) == 6:
        return _axes(in_volume, are_of_patient=False)
    letters = [] if is_quadruped else _by_letters(text_of(fields, "PatientOrientation"))
    if letters:
        return _axes(letters, are_of_patient=True)._replace(note=_BY_LETTERS)
    return _axes(_ALONG_XY, are_of_patient=False)._replace(are_known=False)


def _axes(numbers: list[float], *, are_of_patient: bool) -> Axes:
    row, column = np.reshape(np.array(numbers, np.float64), (2, 3))
    return Axes(row, column, are_known=True, are_of_patient=are_of_patient)


def _by_letters(text: str) -> list[float]:
    """Return the directions that the two words of a text name, by the first letter of each (PS3.3, C.7.6.1.1.1).

    Returns an empty list if the words do not name two directions.
    """
    row, column = ([*(_LETTERS.get(word.strip()[:1], ()) for word in text.split("\\")), (), ()])[:2]
    return [*row, *column] if row and column and not any(a * b for a, b in zip(row, column, strict=True)) else []
