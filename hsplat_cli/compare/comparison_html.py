"""Render a comparison as an HTML page: the verdict, the error over the frames, the worst frames, and all frames."""

from __future__ import annotations

from hsplat_cli.compare.error_plot import plot_errors
from hsplat_cli.compare.figure_format import limit_text, share_text, signed_text, value_text
from hsplat_cli.compare.gallery import PICTURE_PX, Gallery
from hsplat_cli.compare.outcome import Comparison
from hsplat_cli.compare.text_reports import summary
from hsplat_cli.reports import bytes_text, png_data_uri, render_page
from renderer.study import COMPARISON_METRICS, STRICTNESS_LEVELS, severity

# Limits the size of all pictures on the page. Incompressible pictures of a frame take 4 MB: seven frames always fit.
MAX_PICTURE_BYTES = 30_000_000
GAINS = (1, 10, 50)
# Smaller pictures are enlarged by whole pixels up to this size.
_MIN_SHOWN_PX = 384


def comparison_page(comparison: Comparison, gallery: Gallery) -> str:
    """Return the page as text; equal comparisons and pictures give equal text. Needs the package jinja2."""
    outcomes = comparison.outcomes
    frames, num_bytes, largest = [], 0, 0
    for frame in gallery.gallery_frames:  # worst first, as many as fit
        uris = ["" if picture.pixels is None else png_data_uri(picture.pixels) for picture in frame.pictures]
        if num_bytes + sum(map(len, uris)) > MAX_PICTURE_BYTES:
            break
        num_bytes += sum(map(len, uris))
        frames.append((frame, list(zip(frame.pictures, uris, strict=True))))
        difference = frame.pictures[2].pixels
        largest = max(largest, 0 if difference is None else int(difference.max()))
    return render_page(
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
