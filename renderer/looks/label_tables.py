"""Tables of labels, each with a colour: of FreeSurfer, 3D Slicer, ITK-SNAP and FSLeyes.

A label is opaque unless its alpha says something else, and label 0 is transparent, as the background.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from renderer.looks.look import Look
from renderer.looks.look_file import LookFile
from renderer.looks.tables import labels_look

_NUMBER = r"[-+.\deE]+"
_ITK_SNAP = re.compile(rf'(\d+)\s+({_NUMBER})\s+({_NUMBER})\s+({_NUMBER})\s+({_NUMBER})\s+([01])\s+[01]\s+".*"')
_FREESURFER = re.compile(r"(\d+)\s+(\S+)\s+(\d+)\s+(\d+)\s+(\d+)\s+(\d+)(?:\s.*)?")
_FSLEYES = re.compile(rf"(\d+)\s+({_NUMBER})\s+({_NUMBER})\s+({_NUMBER})(?:\s.*)?")


def read_freesurfer(file: LookFile) -> Look:
    """Return the table with rows of label, name, red, green, blue and transparency, from 0 to 255."""
    rows = ((label, rgb, 255.0, 255 - int(clear[:4]), 255.0, line)
            for line, (label, _, *rgb, clear) in _rows(file, _FREESURFER))  # fmt: skip
    return labels_look(file, rows)


def read_slicer(file: LookFile) -> Look:
    """Return the table with rows of label, name, red, green, blue and alpha, from 0 to 255."""
    rows = ((label, rgb, 255.0, alpha, 255.0, line) for line, (label, _, *rgb, alpha) in _rows(file, _FREESURFER))
    return labels_look(file, rows)


def read_itk_snap(file: LookFile) -> Look:
    """Return the table with rows of label, red, green, blue from 0 to 255, alpha from 0 to 1, two flags and a name."""
    rows = ((label, rgb, 255.0, alpha if shown == "1" else 0, 1.0, line)
            for line, (label, *rgb, alpha, shown) in _rows(file, _ITK_SNAP))  # fmt: skip
    return labels_look(file, rows)


def read_fsleyes(file: LookFile) -> Look:
    """Return the table with rows of label, red, green and blue from 0 to 1, and name."""
    rows = ((label, rgb, 1.0, 1, 1.0, line) for line, (label, *rgb) in _rows(file, _FSLEYES))
    return labels_look(file, rows)


def _rows(file: LookFile, pattern: re.Pattern[str]) -> Iterable[tuple[int, Sequence[str]]]:
    for line, text in file.lines():
        found = pattern.fullmatch(text)
        if found is None:
            raise file.error(
                "not a row of a table of labels", line, got=text, expected="a label, its colour and its name"
            )
        yield line, found.groups()
