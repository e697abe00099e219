"""docs/api.md, made from the docstrings of the Python API: `python tests/pages/api_page.py` writes it."""

from __future__ import annotations

import inspect
import re
import textwrap
from collections.abc import Iterator
from pathlib import Path

import renderer

PAGE = Path(__file__).resolve().parents[2] / "docs" / "api.md"
_HEAD = """\
# Python API

`import renderer` is hsplat as a library. From a numpy array to a picture:

```python
import numpy as np

import renderer

array = np.load("scan.npy")  # [z, y, x]
renderer.render_frame(array, spacing=(1, 1, 2))  # a notebook displays it
```

Several volumes make one picture, and an image of another library brings its lengths and axes:

```python
renderer.render_frame([dapi, actin, tubulin])  # each in a colour of its own
renderer.render_frame({"CT": nibabel.load("ct.nii.gz"), "PET": nibabel.load("pet.nii.gz")})
renderer.render_frame(scan, labels=segmentation)  # the scan becomes a shell around them
renderer.render_frame(scan, mask=segmentation > 0)
renderer.render_frame(segmentation, labels={1: "liver", 2: "spleen"})
```

[api.ipynb](api.ipynb) is a notebook with more. Everything is drawn in this process, on all cores, to the same bytes as
by `hsplat render`; arrays are `[z, y, x]`, spacings `(x, y, z)`. Errors are `renderer.HsplatError`: `InputError`, with
its child `SceneError`, for what is wrong with a scene, a volume or a parameter, and `RenderError` for what failed.

This page is made from the docstrings by `tests/pages/api_page.py`.
"""
_NAMES = (
    "render_frame",
    "render",
    "load_scene",
    "suggest_scene",
    "preview",
    "integrate",
    "Layer",
    "Film",
    "FrameImage",
    "ExactImage",
    "Page",
)
_SECTIONS = ("Parameters", "Attributes", "Example")


def api_page() -> str:
    """Return the content of docs/api.md."""
    return "\n".join([_HEAD, *("\n".join(_entry(name)) for name in _NAMES)])


def _entry(name: str) -> Iterator[str]:
    thing = getattr(renderer, name)
    yield f"## {name}"
    yield ""
    if inspect.isfunction(thing):
        signature = inspect.signature(thing)
        bare = [each.replace(annotation=inspect.Parameter.empty) for each in signature.parameters.values()]
        yield from textwrap.wrap(f"    renderer.{name}{inspect.Signature(bare)}", 118, subsequent_indent=" " * 8)
        yield ""
    yield from _markdown(inspect.getdoc(thing) or "")


def _markdown(text: str) -> Iterator[str]:
    section = ""
    for line in text.splitlines():
        if line in _SECTIONS:
            section = line
            yield "```python" if line == "Example" else f"**{line}**"
        elif line and not line.strip("-"):
            yield from () if section == "Example" else ("",)
        elif section == "Example":
            yield re.sub(r"^(>>>|\.\.\.) ", "", line)
        elif section and (found := re.match(r"([a-z_, ]+): (.*)", line)):
            names = ", ".join(f"`{name}`" for name in found[1].split(", "))
            yield f"- {names}: {found[2]}"
        elif section and line.startswith("    "):
            yield f"  {line.strip()}"
        else:
            section = section if line and line.startswith(" ") else "" if not line else section
            yield line
    yield from ("```", "") if section == "Example" else ("",)


if __name__ == "__main__":
    PAGE.write_text(api_page(), encoding="utf-8")
