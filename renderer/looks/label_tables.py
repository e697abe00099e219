"""Tables of labels, each with a colour: of FreeSurfer, 3D Slicer, ITK-SNAP and FSLeyes.

A label is opaque unless its alpha says something else, and label 0 is transparent, as the background.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from renderer.looks.look import Look
from renderer.looks.look_file import LookFile
from renderer.looks.tables import labels_look
from renderer.volume import Label

_NUMBER = r"[-+.\deE]+"
_ITK_SNAP = re.compile(rf'(\d+)\s+({_NUMBER})\s+({_NUMBER})\s+({_NUMBER})\s+({_NUMBER})\s+([01])\s+[01]\s+".*"')
_FREESURFER = re.compile(r"(\d+)\s+\S+\s+(\d+)\s+(\d+)\s+(\d+)\s+(\d+)(?:\s.*)?")
_FSLEYES = re.compile(rf"(\d+)\s+({_NUMBER})\s+({_NUMBER})\s+({_NUMBER})(?:\s.*)?")


def read_freesurfer(file: LookFile) -> Look:
    """Return the table with rows of label, name, red, green, blue and transparency, from 0 to 255."""
    rows = ((line, *row, 255 - file.number(clear, line, 0, 255)) for line, *row, clear in _rows(file, _FREESURFER))
    return labels_look(file, rows, 255.0)


def read_slicer(file: LookFile) -> Look:
    """Return the table with rows of label, name, red, green, blue and alpha, from 0 to 255."""
    return labels_look(file, _rows(file, _FREESURFER), 255.0)


def read_itk_snap(file: LookFile) -> Look:
    """Return the table with rows of label, red, green, blue from 0 to 255, alpha from 0 to 1, two flags and a name."""
    rows = ((line, *row, 255 * (shown == "1") * file.number(alpha, line, 0, 1))
            for line, *row, alpha, shown in _rows(file, _ITK_SNAP))  # fmt: skip
    return labels_look(file, rows, 255.0)


def read_fsleyes(file: LookFile) -> Look:
    """Return the table with rows of label, red, green and blue from 0 to 1, and name."""
    return labels_look(file, ((*row, 1) for row in _rows(file, _FSLEYES)), 1.0)


def read_label_table(path: Path) -> tuple[Label, ...]:
    """Return the labels of a table, by value; raises InputError for a file that is none."""
    raise NotImplementedError(path)


def find_label_table(volume_file: Path) -> Path | None:
    """Return the first file beside a volume that is named like a table of its labels and is one."""
    raise NotImplementedError(volume_file)


def _rows(file: LookFile, pattern: re.Pattern[str]) -> Iterator[tuple[object, ...]]:
    """Yield the number of each line and what a pattern finds in it."""
    for line, text in file.lines():
        found = pattern.fullmatch(text)
        if found is None:
            raise file.error("not a row of a table of labels", line, got=text, expected="a label and its colour")
        yield line, *found.groups()
