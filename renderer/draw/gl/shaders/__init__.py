"""The GLSL sources, read as package data."""

from __future__ import annotations

from importlib.resources import files


def load_shader(*names: str) -> str:
    """One program stage from several files: the version line, then the files in order."""
    return "#version 330 core\n" + "\n".join((files(__name__) / name).read_text("utf-8") for name in names)
