"""Find out whether a picture is dark, and say why: thin matter, a light from elsewhere, or dark colors."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from renderer.film import over_background
from renderer.frame import Stage
from renderer.volume import Float64

# A ray counts as meeting something visible if its opacity is above this: half a step of 8 bits.
_LEAST_OPACITY = 0.5 / 255
# The percentile of rays by which a picture is judged: a few bright spots do not make it bright.
_PERCENTILE = 95.0
# A picture is dark if nearly all rays that meet something visible are darker than this, as a share of white. Suggested
# scenes of 14 scans and presets have 0.49 and more, the gallery's scenes too.
_DARK = 0.15
# Colors are too dark for any light if none of them has a channel as large as this.
_BRIGHT_COLOR = 0.25
# Matter is thin if even its most opaque rays lose less than this share of their light.
_THIN = 0.25


class Darkness(NamedTuple):
    """The brightness of a picture, and a sentence on why it is dark without its full stop; empty if it is not dark.

    brightness: of nearly all rays that meet something visible, from 0 to 1.
    """

    brightness: float
    note: str


def darkness_of(stage: Stage, radiance: Float64) -> Darkness:
    """Return how dark a picture is against a dark background; against a light one, nothing is called dark.

    radiance: of the picture's rays, [n, 4]; in a scene with `light`, of matter in even light, as exact rays have it.
    """
    background, is_linear = stage.scene.background, stage.scene.light is not None
    behind = over_background(np.zeros((1, 1, 4)), background, is_linear=is_linear)
    opacities = radiance[:, 3]
    meets = opacities > _LEAST_OPACITY
    if behind.max() > _DARK or not meets.any():
        return Darkness(1.0, "")
    picture = over_background(radiance[None], background, is_linear=is_linear)[0]
    brightness = float(np.percentile(picture[meets].max(axis=1), _PERCENTILE))
    if brightness >= _DARK:
        return Darkness(brightness, "")
    why = _reason(stage, float(np.percentile(opacities[meets], _PERCENTILE)))
    return Darkness(brightness, f"the picture is dark, at most {100 * brightness:.2g} % of white: {why}")


def _reason(stage: Stage, opacity: float) -> str:
    """Return why a picture is dark, and the keys that make it brighter. opacity: of its most opaque rays."""
    if opacity < _THIN:
        amount = f"matter holds back at most {100 * opacity:.2g} % of the light"
        return f"{amount}; higher opacities, or a smaller transfer_function.unit, make it brighter"
    visible = [layer.transfer.colors[layer.transfer.extinctions > 0] for layer in stage.layers]
    are_bright = max((float(colors.max()) for colors in visible if colors.size), default=0.0) >= _BRIGHT_COLOR
    if are_bright and any(layer.spec.shading is not None for layer in stage.layers):
        keys = "a larger shading.ambient, or shading.light: camera,"
        return f"little light reaches the surfaces that are seen; {keys} makes it brighter"
    return "the colors of the values that are seen are dark; `hsplat info` lists the values that there are"
