"""Render a comparison as an HTML page: the verdict, the error over the frames, the worst frames, and all frames."""

from __future__ import annotations

from collections.abc import Sequence

from hsplat_cli.compare.error_plot import plot_errors
from hsplat_cli.compare.figure_format import limit_text, printable, share_text, signed_text, value_text
from hsplat_cli.compare.gallery import PICTURE_PX, Gallery, GalleryFrame, Pictures
from hsplat_cli.compare.outcome import Comparison
from hsplat_cli.compare.text_reports import summary
from hsplat_cli.reports import bytes_text, png_data_uri, render_page
from renderer.study import COMPARISON_METRICS, STRICTNESS_LEVELS, severity

# Limits the size of all pictures on the page. Incompressible pictures of a frame take 4 MB: seven frames always fit.
MAX_PICTURE_BYTES = 30_000_000
GAINS = (1, 10, 50)
# Kind, data URI or nothing where it is absent, shape, and words on the part of the frame that it shows.
_Picture = tuple[str, str, tuple[int, ...], str]
# Smaller pictures are enlarged by whole pixels up to this size.
_MIN_SHOWN_PX = 384


def comparison_page(comparison: Comparison, gallery: Gallery) -> str:
    """Return the page as text; equal comparisons and pictures give equal text. Needs the package jinja2."""
    frames, num_bytes = _shown_frames(gallery.gallery_frames)
    outcomes = comparison.outcomes
    differences = [frame.overview["difference"] for frame in gallery.gallery_frames]
    largest = max((int(levels.max()) for levels in differences if levels is not None), default=0)
    text = render_page(
        "compare.html",
        title=summary(comparison),
        comparison=comparison,
        purpose=STRICTNESS_LEVELS[comparison.level].purpose,
        plot=plot_errors(comparison),
        frames=frames,
        anchors={frame.outcome.name: f"worst-{number}" for number, (frame, _) in enumerate(frames, 1)},
        order={outcome.name: number for number, outcome in enumerate(outcomes)},
        size=bytes_text(num_bytes),
        picture_px=PICTURE_PX,
        gains=GAINS,
        default_gain=GAINS[-1] if largest * GAINS[-1] <= 255 else GAINS[-2],  # tells the errors of all frames apart
        metrics=[metric for name, metric in COMPARISON_METRICS.items() if any(name in o.figures for o in outcomes)],
        min_shown_px=_MIN_SHOWN_PX,
        value_text=value_text,
        limit_text=limit_text,
        share_text=share_text,
        bias_lines=lambda bias: zip(("red", "green", "blue", "alpha"), map(signed_text, bias), strict=False),
        severity=severity,
    )
    # File names may hold any bytes, also invalid UTF-8.
    return "\n".join(line if line.isprintable() else printable(line) for line in text.split("\n"))


def _shown_frames(gallery_frames: Sequence[GalleryFrame]) -> tuple[list[tuple[GalleryFrame, list[_Picture]]], int]:
    """Return the frames that fit, worst first, with their pictures, and the bytes of these."""
    frames: list[tuple[GalleryFrame, list[_Picture]]] = []
    num_bytes = 0
    for frame in gallery_frames:
        pictures = _pictures(frame.overview, "")
        if frame.crop is not None and frame.crop["golden"] is not None:
            (x, y), (height, width, _) = frame.corner, frame.crop["golden"].shape
            pictures += _pictures(frame.crop, f", enlarged: x {x} to {x + width - 1}, y {y} to {y + height - 1}")
        size = sum(len(uri) for _, uri, _, _ in pictures)
        if num_bytes + size > MAX_PICTURE_BYTES:
            break
        num_bytes += size
        frames.append((frame, pictures))
    return frames, num_bytes


def _pictures(pictures: Pictures, extent: str) -> list[_Picture]:
    return [
        (kind, "", (), "") if pixels is None else (kind, png_data_uri(pixels), pixels.shape, extent)
        for kind, pixels in pictures.items()
    ]
