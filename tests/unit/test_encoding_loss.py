"""The advice about frames that are far more exact than their file."""

from __future__ import annotations

import math
from pathlib import Path

from renderer.accuracy import finer_than_kept, typical_kept_psnr, typical_psnr
from renderer.scene import OutputSpec


def test_what_formats_keep() -> None:
    kept = [typical_kept_psnr(OutputSpec(Path("a.mp4"), (8, 8), quality=quality)) for quality in (2, 8, 10)]
    assert kept == sorted(kept)
    assert 35 < kept[0] < 40 < kept[1] < 46 < kept[2] < 50
    assert 45 < typical_kept_psnr(OutputSpec(Path("a.gif"), (8, 8))) < 52
    assert typical_kept_psnr(OutputSpec(Path("{frame}.png"), (8, 8))) == math.inf


def test_the_advice_names_a_tolerance_that_is_still_finer_than_the_file() -> None:
    assert finer_than_kept(59.0, 44.0) is None
    assert finer_than_kept(200.0, math.inf) is None
    assert finer_than_kept(61.0, 44.0) == (
        "file PSNR about 44 dB, frames PSNR 61 dB before encoding: tolerance 0.1, or psnr 52, gives nearly the same "
        "film sooner"
    )
    assert ", exact frames before encoding" in str(finer_than_kept(typical_psnr(0.0), 44.0))
