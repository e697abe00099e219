"""A component of a file with several, as the file describes it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Channel:
    """A description of one component of a file; all of it may be unknown.

    name: printable. color: in [0, 1]. window: the values that are shown as black and as full colour.
    is_light: whether it is light of its own, as of fluorescence, and not a part of a colour or of a vector; known of a
        Volume.
    """

    name: str = ""
    color: tuple[float, float, float] | None = None
    window: tuple[float, float] | None = None
    is_light: bool | None = None
