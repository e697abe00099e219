"""Import colormaps of FSLeyes, .cmap: rows of red, green and blue from 0 to 1, evenly over the data's range."""

from __future__ import annotations

from renderer.looks.color_tables import even_look
from renderer.looks.look import Look
from renderer.looks.look_file import LookFile


def read(file: LookFile) -> Look:
    """Return the colormap in a file."""
    return even_look(file, [(line, *text.split()) for line, text in file.lines()], 1.0)
