"""Named colormaps, from the catalogue of the package `cmap`, and ParaView's names for some of them.

Importing `cmap` imports numpy, so names are checked without it: each of its data folders has a `record.json`.
"""

from __future__ import annotations

import importlib.util
import itertools
import json
from collections.abc import Iterator
from pathlib import Path

from renderer.errors import closest_match

# ParaView's names of colormaps, each with the name of the same colormap in the package `cmap`: on average, 256 colours
# of both differ by less than 0.012. Names that `cmap` has, too, are left out: they mean the colormaps of `cmap`.
_PARAVIEW = {
    "cool_to_warm": "coolwarm",
    "warm_to_cool": "coolwarm_r",
    "grayscale": "gray",
    "x_ray": "gray_r",
    "2hot": "matlab:hot",
    "red_temperature": "yorick:heat",
    **{f"{name}_(matplotlib)": f"bids:{name}" for name in ("viridis", "inferno", "plasma", "magma")},
    **{f"{name}_matlab": f"matlab:{name}" for name in ("copper", "pink", "bone")},
    **{"gray_and_red": "rdgy_r", "gyrd": "rdgy_r", "spectral_lowblue": "spectral_r"},
    **{"gnrp": "prgn_r", "gypi": "piyg_r", "gnylrd": "rdylgn_r", "gbbr": "brbg_r", "orpu": "puor_r"},
    **{"gnbupu": "pubugn_r", "bugnyl": "ylgnbu_r", "rdor": "orrd_r", "broryl": "ylorbr_r", "rdoryl": "ylorrd_r"},
}


def is_colormap(name: str) -> bool:
    """Return whether `colormap_points` knows this name. Case is ignored; blanks and dashes count as underscores."""
    return any(_normal(known) == _base(_in_catalogue(name)) for known in _names())


def nearest_colormap(name: str) -> str | None:
    """Return the known name that is most similar to an unknown one, or None if none is similar.

    The suffix `_r`, which reverses a colormap, is kept.
    """
    base = _base(name)
    short = ":" not in base
    found = closest_match(base, (each for each in sorted({*_names(), *_PARAVIEW}) if (":" not in each) == short))
    return f"{found}_r" if found and base != _normal(name) else found


def colormap_points(name: str, count: int) -> list[tuple[float, float, float]]:
    """Return `count` >= 2 colours (r, g, b) in [0, 1], evenly spaced from the colormap's first to its last.

    name: a name that `is_colormap` accepts. The function imports cmap, and with it numpy.
    """
    import cmap

    name = _in_catalogue(name)
    base = _base(name)
    # A full name avoids cmap's warning about short names that several collections share.
    full = cmap.Colormap.catalog().resolve(base)
    colors = cmap.Colormap(full if base == _normal(name) else f"{full}_r").lut(count)
    return [(float(r), float(g), float(b)) for r, g, b, _ in colors]


def _in_catalogue(name: str) -> str:
    """Return the name in the catalogue of `cmap` for ParaView's name of a colormap; return other names unchanged."""
    meant = _PARAVIEW.get(_base(name), name)
    is_reversed = _base(name) != _normal(name)
    return meant if meant == name or not is_reversed else _base(meant) + "_r" * (_base(meant) == meant)


def _normal(name: str) -> str:
    return name.lower().replace(" ", "_").replace("-", "_")


def _base(name: str) -> str:
    return _normal(name).removesuffix("_r")


def _names() -> Iterator[str]:
    """Yield the names of all colormaps in the catalogue of `cmap`. Each file is read when its names are needed.

    Each colormap has two names: a short one (`viridis`), and one with its collection (`bids:viridis`).
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
