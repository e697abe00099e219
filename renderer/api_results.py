"""Define what the functions of the Python API return: pictures, films and pages, which notebooks display."""

from __future__ import annotations

import base64
import html
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from renderer.film import encode_png, frame_path
from renderer.record import FilmAccuracy, FilmVisibility, accuracy_text
from renderer.scene import format_of
from renderer.system import printable


class FrameImage(np.ndarray[tuple[int, ...], np.dtype[np.uint8]]):  # from NumPy 2.5 on, npt.NDArray is no class
    """A picture: a uint8 array [height, width, 3 or 4] that notebooks display.

    It is a numpy array in every other respect: `image.shape`, `image[:100]`, `np.asarray(image)`. Row 0 is the top. The
    fourth channel, where the background is transparent, is straight alpha.
    """

    def _repr_png_(self) -> bytes | None:
        """Return the picture as the bytes of a PNG file; None for an array that is no picture, such as one channel."""
        is_picture = self.dtype == np.uint8 and self.ndim == 3 and self.shape[2] in (3, 4) and self.size > 0
        return encode_png(np.ascontiguousarray(self)) if is_picture else None


class ExactImage(np.ndarray[tuple[int, ...], np.dtype[np.float32]]):
    """An exact picture: a float32 array [height, width, 3], with colours from 0 to 1.

    It is a numpy array in every other respect.

    Attributes
    ----------
    standard_error
        The root of the mean variance of its pixels, each the mean of a few rays or paths; NaN for arrays that are made
        from the picture.
    """

    standard_error: float = math.nan


@dataclass(frozen=True)
class Film:
    """A film that `render` wrote, which notebooks play.

    Attributes
    ----------
    path
        The file, or the template of the numbered frames, such as `frames/{frame:04}.png`.
    frames
        The numbers of the film's frames.
    sidecar
        The JSON file beside the film, which records how the film was made and the cost of each frame.
    notes
        Remarks on the film, for example that nothing is in view; mostly empty.
    accuracy
        The accuracy of the frames, measured by exact rays: `psnr` in decibels, its 95 % `interval`, the `worst` frame,
        and `file.psnr`, the PSNR after encoding; None if nothing was measured.
    visibility
        The scalars that the frames show, measured by exact rays: `coverage`, the mean opacity, and `ranges` of scalars
        with `low`, `high` and their `share` of the visible scalars; None if nothing was measured.
    """

    path: Path
    frames: tuple[int, ...]
    sidecar: Path
    notes: tuple[str, ...] = ()
    accuracy: FilmAccuracy | None = None
    visibility: FilmVisibility | None = None

    def _repr_html_(self) -> str:
        """Return HTML that shows the film, or its first picture, with a caption."""
        first, kind = frame_path(self.path, self.frames[0]), format_of(self.path).media_type
        data = f"data:{kind};base64,{base64.b64encode(first.read_bytes()).decode()}"
        element = '<img src="{}">' if kind.startswith("image/") else '<video controls loop muted src="{}"></video>'
        count = f"{len(self.frames)} frame{'s' * (len(self.frames) != 1)}"
        exact = [] if self.accuracy is None else [accuracy_text(self.accuracy), _error_in_words(self.accuracy)]
        lines = [f"{self.path}: {count}; how it was made: {self.sidecar}", *exact, *self.notes]
        caption = "<br>".join(html.escape(printable(line)) for line in lines)
        return f"<figure>{element.format(data)}<figcaption>{caption}</figcaption></figure>"


def _error_in_words(accuracy: FilmAccuracy) -> str:
    """Return a sentence on the root of the mean squared error of what is in the file."""
    levels = 255 * 10 ** (-(accuracy.file or accuracy).psnr / 20)
    return f"measured by exact rays: colours are off by {levels:.2g} of 255 levels (root mean square)"


@dataclass(frozen=True)
class Page:
    """A page in one HTML file, which notebooks display.

    Attributes
    ----------
    html
        The content of the file.
    """

    html: str

    def _repr_html_(self) -> str:
        """Return HTML that shows the page, in an `iframe`."""
        content = html.escape(self.html)
        return f'<iframe sandbox="allow-scripts" srcdoc="{content}" width="100%" height="640"></iframe>'
