"""Renders HTML pages: templates, colours, and pictures as data URIs.

A page is one file without external resources, and follows the reader's choice of a light or dark scheme.
"""

from __future__ import annotations

import base64
import io
import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from PIL import Image

from hsplat_cli.reports.charts import MARKERS
from renderer.errors import InputError
from renderer.film import encode_png, translate_os_errors
from renderer.scene import require_file
from renderer.system import join_lines

if TYPE_CHECKING:
    from jinja2 import Environment

# The colours of CSS variables, on a light and on a dark ground. The series are the eight colours of M. Okabe and K.
# Ito, "Color Universal Design" (2008), darker on white where they would be faint, and lighter on black.
PALETTE = {
    "ink": ("#1c1e21", "#e6e6e3"),
    "muted": ("#5c6066", "#a3a6aa"),
    "line": ("#d5d7da", "#3a3d41"),
    "ground": ("#fdfdfc", "#17181a"),
    "raised": ("#f2f3f4", "#222427"),
    "front": ("#fbe7b2", "#4d4119"),
    "series-1": ("#0072b2", "#5fb2e6"),
    "series-2": ("#d55e00", "#ff8b3d"),
    "series-3": ("#009e73", "#2fc99c"),
    "series-4": ("#b8558f", "#e59cc6"),
    "series-5": ("#c28500", "#f0b93a"),
    "series-6": ("#3a9fd9", "#a5dbfa"),
    "series-7": ("#857a00", "#f0e442"),
    "series-8": ("#6b6f76", "#b4b7bb"),
}

# The bytes by which a page of hsplat is recognised; they are in the page's style, near its beginning.
_MARK = b"/* by hsplat"
# Number of bytes at the beginning of a page in which `require_own_page` looks for _MARK.
_MAX_HEAD_BYTES = 2**16

# Quality of WebP pictures in pages, on a scale to 100.
_WEBP_QUALITY = 80


def require_own_page(page: Path) -> None:
    """Raise InputError if a page exists that hsplat has not made."""
    require_file(page, "the name of a page")
    with translate_os_errors(page):
        if not page.exists():
            return
        with page.open("rb") as stream:
            is_own = _MARK in stream.read(_MAX_HEAD_BYTES)
    if not is_own:
        raise InputError("another page has this name", where=str(page), hint="move it, or give another --output")


def render_page(template: str, *, title: str, **values: object) -> str:
    """Return the page that a template of this package gives; every value except for Markup is escaped.

    values: the template's variables; a missing one raises jinja2.UndefinedError.
    """
    text: str = page_environment().get_template(template).render(title=title, **values)
    return join_lines(text.split("\n"))


def page_environment() -> Environment:
    """Return the environment of the templates, with filters `data_uri`, `webp_uri` (pictures) and `sort_key`."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("hsplat_cli.reports"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters |= {"data_uri": png_data_uri, "webp_uri": webp_data_uri, "sort_key": sort_key}
    environment.globals |= {"palette": PALETTE, "markers": MARKERS}
    return environment


def png_data_uri(pixels: npt.NDArray[np.uint8]) -> str:
    """Return `data:image/png;base64,...` of pixels, uint8 [h, w, 3] or, with straight alpha, [h, w, 4]."""
    return f"data:image/png;base64,{base64.b64encode(encode_png(pixels)).decode('ascii')}"


def webp_data_uri(pixels: npt.NDArray[np.uint8]) -> str:
    """Return `data:image/webp;base64,...` of uint8 pixels, with a hardly visible loss and a tenth of PNG's bytes."""
    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, "WEBP", quality=_WEBP_QUALITY, method=4)
    return f"data:image/webp;base64,{base64.b64encode(stream.getvalue()).decode('ascii')}"


def sort_key(value: float | None) -> str:
    """Return the text by which a table of a page sorts a number: its JavaScript form; empty for None and NaN."""
    return "" if value is None or math.isnan(value) else repr(float(value)).replace("inf", "Infinity")


def format_facts(mapping: Mapping[str, object]) -> list[tuple[str, str]]:
    """Return the name and the text of each entry of a mapping, for the list of facts at the head of a page."""
    return [(name.replace("_", " "), _format_fact(value)) for name, value in mapping.items()]


def _format_fact(value: object) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{name} {_format_fact(item)}" for name, item in value.items())
    if isinstance(value, (list, tuple, np.ndarray)):
        return " x ".join(map(_format_fact, value))
    return "unknown" if value is None else str(value)
