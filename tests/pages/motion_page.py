"""Write the list of keys that can move into docs/scene.md: `python tests/pages/motion_page.py`."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from pathlib import Path

from renderer.scene import SECTIONS, schema

MOTION_PAGE = Path(__file__).resolve().parents[2] / "docs" / "scene.md"
_HEADING = "of all others it is an error.\n"
_WORDS = {"linear": "", "ratio": " (in even ratios)", "direction": " (on the sphere)"}


def motion_page() -> str:
    """Return the page with the list that follows from the types of all keys."""
    text, _, _ = MOTION_PAGE.read_text("utf-8").partition(_HEADING)
    lines = []
    for section, field in SECTIONS.items():
        keys = [f"`{key}`{_WORDS[motion]}" for key, motion in moving_keys(field.table or {})]
        lines += textwrap.wrap(f"- `{section}`: {', '.join(keys)}", 120, subsequent_indent="  ") if keys else []
    return f"{text}{_HEADING}\n" + "\n".join(lines) + "\n\nOf labels, the color and the opacity of each, too.\n"


def moving_keys(table: schema.FieldTable, prefix: str = "") -> Iterator[tuple[str, str]]:
    """Yield the dotted path of each key that can move, and how it does; list items have no number."""
    for key, field in table.items():
        if field.motion is not None:
            yield prefix + key, field.motion
        yield from moving_keys(field.table or {}, f"{prefix}{key}.")


if __name__ == "__main__":
    MOTION_PAGE.write_text(motion_page(), "utf-8")
