"""Named colormaps, from the catalogue of the package `cmap`.

Importing `cmap` imports numpy, so names are checked without it: each of its data folders has a `record.json`.
"""

from __future__ import annotations

import importlib.util
import itertools
import json
from collections.abc import Iterator
from pathlib import Path

from renderer.errors import closest_match


def is_colormap(name: str) -> bool:
    """Return whether `colormap_points` knows this name, in any case and with blanks, dashes or underscores."""
    return any(_normal(known) == _base(name) for known in _names())


def nearest_colormap(name: str) -> str | None:
    """Return the colormap with the most similar name, or None; `_r` is kept."""
    base = _base(name)
    short = ":" not in base
    found = closest_match(base, (known for known in sorted(set(_names())) if (":" not in known) == short))
    return f"{found}_r" if found and base != _normal(name) else found


def colormap_points(name: str, count: int) -> list[tuple[float, float, float]]:
    """Return `count` >= 2 colours (r, g, b) in [0, 1], evenly spaced from the colormap's first to its last.

    name: one that `is_colormap` accepts. Imports cmap, and with it numpy.
    """
    import cmap

    base = _base(name)
    # A full name avoids cmap's warning about short names that several collections share.
    full = cmap.Colormap.catalog().resolve(base)
    colors = cmap.Colormap(full if base == _normal(name) else f"{full}_r").lut(count)
    return [(float(r), float(g), float(b)) for r, g, b, _ in colors]


def _normal(name: str) -> str:
    return name.lower().replace(" ", "_").replace("-", "_")


def _base(name: str) -> str:
    return _normal(name).removesuffix("_r")


def _names() -> Iterator[str]:
    """Yield the names in the catalogue's spelling, lazily: common ones are in the first files.

    They are short (`viridis`) and with their collection (`bids:viridis`).
    """
    spec = importlib.util.find_spec("cmap")
    assert spec is not None and spec.origin is not None, "it is required"
    for record in sorted(Path(spec.origin).parent.glob("data/*/record.json")):
        content = json.loads(record.read_text(encoding="utf-8"))
        collection = content["namespace"]
        for name, entry in content["colormaps"].items():
            yield name
            for alias in itertools.chain([name], entry.get("aliases", [])):
                yield f"{collection}:{alias}"
