"""Render HTML pages: template, colours, plots as SVG and pictures as data URIs.

A page is one file without external resources. Pages and plots follow the reader's choice of light or dark: matplotlib
draws with the light colours, and `figure_to_svg` replaces each by the CSS variable of the same name.
"""

from __future__ import annotations

import base64
import io
import math
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from PIL import Image

from renderer.errors import InputError, require_package
from renderer.film import encode_png, translate_os_errors
from renderer.scene import require_file
from renderer.system import join_lines

if TYPE_CHECKING:
    from markupsafe import Markup
    from matplotlib.figure import Figure

# CSS variable: colour on light and on dark ground. The series have the eight colours of M. Okabe and K. Ito, "Color
# Universal Design" (2008), darker on white where they would be faint, lighter on black.
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
LIGHT_PALETTE = {name: light for name, (light, _) in PALETTE.items()}
SERIES_COLORS = tuple(color for name, color in LIGHT_PALETTE.items() if name.startswith("series-"))

# In the style of every page. It stands within the first bytes, of which this many are read.
_MARK = b"/* by hsplat"
_MAX_HEAD_BYTES = 2**16

# Of 100.
_WEBP_QUALITY = 80

_STYLE: dict[str, Any] = {
    "svg.fonttype": "none",  # text stays text: it can be searched, read aloud, and is small
    "svg.hashsalt": "hsplat",  # makes ids the same in every run
    "text.parse_math": False,  # a $ in a name is a $
    "font.size": 10.0,
    "figure.facecolor": "none",
    "axes.facecolor": "none",
    "axes.titlesize": 11.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": LIGHT_PALETTE["line"],
    "grid.linewidth": 0.6,
    "legend.frameon": False,
    **dict.fromkeys(("axes.labelcolor", "text.color", "xtick.labelcolor", "ytick.labelcolor"), LIGHT_PALETTE["ink"]),
    **dict.fromkeys(("axes.edgecolor", "xtick.color", "ytick.color"), LIGHT_PALETTE["muted"]),
}


@dataclass(frozen=True)
class Chart:
    """A plot with its caption. alt: describes it to readers who cannot see it; by default as the caption does."""

    plot: Figure
    caption: str
    alt: str = ""


def require_page_packages() -> None:
    """Raise InputError if the package that plots of pages need is missing."""
    require_package("matplotlib", extra="measure")


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
    """Return the page of a template of this package; every value but Markup is escaped, and all is printable.

    values: the template's variables; a missing one raises jinja2.UndefinedError. Templates have the filters `data_uri`
    and `webp_uri` for uint8 pixels, `sort_key` for numbers, and `svg(name, alt)` for matplotlib figures, inside
    `plot_style`.
    """
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("hsplat_cli.reports"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters |= {
        "data_uri": png_data_uri,
        "webp_uri": webp_data_uri,
        "sort_key": sort_key,
        "svg": figure_to_svg,
    }
    text: str = environment.get_template(template).render(title=title, palette=PALETTE, **values)
    return join_lines(text.split("\n"))


@contextmanager
def plot_style() -> Iterator[None]:
    """Apply the style of the page to figures that are made and turned into SVG inside the block."""
    from matplotlib import rc_context, rcParamsDefault

    # matplotlib's defaults in place of the user's matplotlibrc; the backend stays as it is set.
    defaults: dict[Any, Any] = {key: value for key, value in rcParamsDefault.items() if not key.startswith("backend")}
    with rc_context(defaults | _STYLE):
        yield


def figure_to_svg(figure: Figure, name: str, alt: str) -> Markup:
    """Return a figure as an `<svg>` element in the page's colours; equal figures give equal bytes. Inside `plot_style`.

    name: unique on the page; all ids begin with it. alt: describes the figure to readers who cannot see it.
    """
    from markupsafe import Markup, escape

    stream = io.StringIO()
    figure.savefig(stream, format="svg", metadata={"Date": None, "Creator": None, "Format": None, "Type": None})
    svg = stream.getvalue()
    svg = svg[svg.index("<svg") :]  # HTML has no XML declaration and another document type
    opening, _, body = svg.partition(">")
    (view_box,) = re.findall(r'viewBox="[^"]*"', opening)
    body = re.sub(r"<metadata>.*?</metadata>", "", body, flags=re.DOTALL).replace("xlink:href", "href")
    body = re.sub(r'\bid="', f'id="{name}-', body)
    body = body.replace('href="#', f'href="#{name}-').replace("url(#", f"url(#{name}-")
    for variable, color in LIGHT_PALETTE.items():
        body = body.replace(color, f"var(--{variable})")
    return Markup(f'<svg {view_box} role="img" aria-label="{escape(alt)}">{body}')


def png_data_uri(pixels: npt.NDArray[np.uint8]) -> str:
    """Return `data:image/png;base64,...` of uint8 [h, w, 3] or, with straight alpha, [h, w, 4]."""
    return f"data:image/png;base64,{base64.b64encode(encode_png(pixels)).decode('ascii')}"


def webp_data_uri(pixels: npt.NDArray[np.uint8]) -> str:
    """Return `data:image/webp;base64,...` of such pixels, with a loss that is hardly seen: a tenth of the bytes."""
    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, "WEBP", quality=_WEBP_QUALITY, method=4)
    return f"data:image/webp;base64,{base64.b64encode(stream.getvalue()).decode('ascii')}"


def sort_key(value: float | None) -> str:
    """Return a number as JavaScript spells it; empty for None and NaN, which sort last."""
    return "" if value is None or math.isnan(value) else repr(float(value)).replace("inf", "Infinity")


def format_facts(mapping: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return name and text of each entry, for the list at the head of a page."""
    return [(name.replace("_", " "), _format_fact(value)) for name, value in mapping.items()]


def _format_fact(value: object) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{name} {_format_fact(item)}" for name, item in value.items())
    if isinstance(value, (list, tuple, np.ndarray)):
        return " x ".join(map(_format_fact, value))
    return "unknown" if value is None else str(value)
