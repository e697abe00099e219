"""Define the description of one of several components of a file, such as a channel of a microscope."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Channel:
    """A description of one component of a file. Every field may be unknown.

    name: the component's name, printable. color: red, green and blue in [0, 1]. window: the values that are shown as
        black and as full colour.
    is_light: whether the component is light of its own, such as a fluorescence, and not a part of a colour or of a
        vector; None only before a Volume is made.
    is_hidden: whether the file says that the component is not shown unless somebody asks for it.
    """

    name: str = ""
    color: tuple[float, float, float] | None = None
    window: tuple[float, float] | None = None
    is_light: bool | None = None
    is_hidden: bool = False
