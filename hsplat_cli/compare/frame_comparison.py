"""Compare the picture of a frame with a golden."""

from __future__ import annotations

from dataclasses import replace

from hsplat_cli.compare.difference import PART_PX, Figures, has_flip, measure_difference, measure_flip
from hsplat_cli.compare.limit import NOT_STATED, Limit, Stated
from hsplat_cli.compare.outcome import ComparedFrame, Status
from renderer.film import Pixels
from renderer.scene import counted

# Names of the kinds of pictures, by their number of channels.
_KINDS = {3: "RGB", 4: "RGBA"}


def compare_frame(
    name: str,
    golden: Pixels | None,
    actual: Pixels | None,
    limit: Limit,
    stated: Stated = NOT_STATED,
) -> ComparedFrame:
    """Compare a picture with its golden, uint8 [h, w, 3 or 4] with straight alpha; None for one that is missing."""
    if golden is None or actual is None:
        if actual is None:
            return ComparedFrame(name, "missing", "this frame was not drawn")
        return ComparedFrame(name, "new", "there is no golden of this frame")
    (height, width, channels), (actual_height, actual_width, actual_channels) = golden.shape, actual.shape
    if (height, width) != (actual_height, actual_width):
        why = f"{actual_width} x {actual_height} pixels, the golden has {width} x {height}"
        return ComparedFrame(name, "other size", why)
    if channels != actual_channels:
        change = "lost" if channels == 4 else "new"
        why = f"{_KINDS[actual_channels]}, the golden is {_KINDS[channels]}: alpha is {change}"
        return ComparedFrame(name, "other channels", why)
    figures = measure_difference(golden, actual)
    frame = _judged(name, figures, limit, stated)
    if frame.status == "different" and has_flip():
        frame = replace(frame, flip=measure_flip(golden, actual))
    return frame


def _judged(name: str, figures: Figures, limit: Limit, stated: Stated) -> ComparedFrame:
    """Return the outcome of a frame by the figures of its difference."""
    least = limit.least_psnr(stated)
    status: Status
    if figures.is_same:
        status, why = "same", "the same stored values"
    elif limit.passes(figures, stated):
        status, why = "close", f"{_difference(figures)}; {limit.words}"
    else:
        status, why = "different", f"{_difference(figures)}; wanted: {limit.words}"
        if limit.kind == "stated accuracy" and None in stated:
            why += ", but they do not state theirs"
        elif limit.kind == "stated accuracy":
            why += f" ({least:.1f} dB)"
    return ComparedFrame(
        name, status, why, psnr=figures.psnr, part_psnr=figures.part_psnr, part=figures.part,
        largest=figures.largest, least=least,
    )  # fmt: skip


def _difference(figures: Figures) -> str:
    """Return a difference in words: `41.3 dB, 22.8 dB in 8 x 8 pixels at 120, 64, largest error 31 steps`."""
    if figures.largest == 0:
        return "the same picture, but for colours at an alpha of 0"
    x, y = figures.part
    part = f"{figures.part_psnr:.1f} dB in {PART_PX} x {PART_PX} pixels at {x}, {y}"
    return f"{figures.psnr:.1f} dB, {part}, largest error {counted(round(figures.largest), 'step')} of 255"
