"""Measure what a film file loses of its frames, and say what is typical, and which tolerance would do as well.

Typical values are those of many scans drawn as bricks (docs/benchmarks/goals.md). What a film has is measured when it
is made.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from renderer.scene import OutputFile

if TYPE_CHECKING:
    from renderer.film import Pixels

# To which typical losses of the table of formats belong.
_USUAL_QUALITY = 8.0
# Bricks have about this PSNR at this tolerance.
_TOLERANCE, _TOLERANCE_DB, _DB_PER_DECADE = 0.1, 53.0, 17.0
# Frames that are better by the first than what the file keeps are worth a word. With the second, the error of the film
# is a sixth more.
_TOO_GOOD_DB, _GOOD_ENOUGH_DB = 16.0, 8.0


def encoding_loss(output: OutputFile, num_frames: int, first_frames: Sequence[Pixels]) -> float:
    """Return the mean squared error of the first frames of a film as they are decoded, over black, in [0, 1].

    Of transparent ones the error of alpha counts, too: it is that over any background in the end.
    """
    # Imported here: `hsplat check` needs the rest of this file alone.
    import numpy as np

    from renderer.film import decode_known_film, over_black

    with decode_known_film(output, num_frames) as decoded:
        pairs = zip(first_frames, decoded, strict=False)
        return float(np.mean([np.mean((over_black(drawn) - over_black(kept)) ** 2) for drawn, kept in pairs]))


def typical_psnr(tolerance: float) -> float:
    """Return about which PSNR bricks have at a tolerance; infinity at 0."""
    return _TOLERANCE_DB + _DB_PER_DECADE * math.log10(_TOLERANCE / tolerance) if tolerance > 0 else math.inf


def typical_tolerance(decibels: float) -> float:
    """Return about which tolerance gives bricks a PSNR."""
    return float(_TOLERANCE * 10 ** ((_TOLERANCE_DB - decibels) / _DB_PER_DECADE))


def typical_kept_psnr(output: OutputFile) -> float:
    """Return about which PSNR a decoded film has from its frames; infinity for frames in files."""
    if output.is_frames:
        return math.inf
    usual, per_step = output.chosen_codec.kept_psnr
    return usual + per_step * (output.quality - _USUAL_QUALITY)


def finer_than_kept(psnr: float, kept: float) -> str | None:
    """Return what to say where frames are far more exact than what the file keeps of them, both in decibels."""
    if psnr < kept + _TOO_GOOD_DB:
        return None
    wanted = kept + _GOOD_ENOUGH_DB
    tolerance = float(f"{typical_tolerance(wanted):.1g}")
    had = "exact frames" if math.isinf(psnr) else f"frames PSNR {psnr:.0f} dB"
    return (
        f"file PSNR about {kept:.0f} dB, {had} before encoding: tolerance {tolerance:g}, or psnr {wanted:.0f}, gives "
        "nearly the same film sooner"
    )
