"""Find out whether a picture is dark, and say why: thin matter, a light from elsewhere, or dark colors.

For thin matter the factor on all extinctions is solved by which the object holds back as much light as in a suggested
picture. The opacities that rays already have are enough for this: a factor on extinctions is one on optical depths.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from renderer.film import over_background
from renderer.frame import Stage
from renderer.suggest import DEFAULT_COVERAGE
from renderer.volume import Float64

# A ray counts as meeting something visible if its opacity is above this: half a step of 8 bits.
_LEAST_OPACITY = 0.5 / 255
# The percentile of rays by which a picture is judged: a few bright spots do not make it bright.
_PERCENTILE = 95.0
# A picture is dark if nearly all rays that meet something visible are darker than this, as a share of white. Suggested
# scenes of 14 scans and presets have 0.49 and more, the gallery's scenes too.
DARK = 0.15
# Colors are too dark for any light if none of them has a channel as large as this.
_BRIGHT_COLOR = 0.25
# Matter is thin if even its most opaque rays lose less than this share of their light.
_THIN = 0.25
# A ray meets the object, and not a haze around it, if its opacity is more than this share of that of opaque rays.
_OF_OBJECT = 0.1
# The largest natural logarithm of a factor on extinctions that is looked for, and the number of halvings of the search.
_MAX_LOG_FACTOR = 20.0
_NUM_HALVINGS = 40


class Darkness(NamedTuple):
    """A reason why a picture is dark, with the keys that make it brighter: a part of a sentence.

    factor: the factor on all extinctions that makes thin matter visible; 1 if the matter is not thin.
    """

    why: str
    factor: float = 1.0


# A function that returns the radiance of the rays of a picture with all extinctions multiplied by a factor.
DrawDenser = Callable[[float], Float64]


def brightness_of(stage: Stage, radiance: Float64) -> float:
    """Return the brightness of nearly all rays that meet something visible, from 0 to 1.

    It is 1 against a light background, against which nothing is called dark, and where nothing is visible.

    radiance: of the picture's rays, [n, 4]; in a scene with `light`, of matter in even light, as exact rays have it.
    """
    background, is_linear = stage.scene.background, stage.scene.light is not None
    behind = over_background(np.zeros((1, 1, 4)), background, is_linear=is_linear)
    meets = radiance[:, 3] > _LEAST_OPACITY
    if behind.max() > DARK or not meets.any():
        return 1.0
    picture = over_background(radiance[None], background, is_linear=is_linear)[0]
    return float(np.percentile(picture[meets].max(axis=1), _PERCENTILE))


def explain_darkness(stage: Stage, radiance: Float64, draw_denser: DrawDenser) -> Darkness:
    """Say why a picture is dark. radiance: as in `brightness_of`."""
    return explain_thinness(stage, radiance, draw_denser) or Darkness(_reason(stage))


def explain_thinness(stage: Stage, radiance: Float64, draw_denser: DrawDenser) -> Darkness | None:
    """Say how thin the matter of a picture is; None if it is not thin, or if rays meet no matter.

    radiance: as in `brightness_of`.
    """
    opacities = radiance[:, 3]
    opacities = opacities[opacities > (_LEAST_OPACITY if opacities.max() > _LEAST_OPACITY else 0)]
    if not opacities.size or (opacity := float(np.percentile(opacities, _PERCENTILE))) >= _THIN:
        return None
    amount = f"matter holds back at most {100 * opacity:.2g} % of the light"
    if stage.scene.mode.is_projection:
        return Darkness(f"{amount}; higher opacities make it brighter")
    factor = _rounded(stage, _factor(opacities[opacities > _OF_OBJECT * opacity]))
    remedy = f"{amount}; with {_options(stage, factor)} it is"
    if brightness_of(stage, draw_denser(factor)) < DARK:
        return Darkness(f"{remedy} denser, but {_reason(stage)}", factor)
    return Darkness(f"{remedy} visible", factor)


def _factor(opacities: Float64) -> float:
    """Return the factor on extinctions with which rays have the mean opacity of a suggested picture."""
    with np.errstate(divide="ignore"):  # the depth of an opaque ray is infinite
        depths = -np.log1p(-opacities)
    low, high = 0.0, _MAX_LOG_FACTOR
    for _ in range(_NUM_HALVINGS):
        middle = (low + high) / 2
        is_thin = float(-np.expm1(-np.exp(middle) * depths).mean()) < DEFAULT_COVERAGE
        low, high = (middle, high) if is_thin else (low, middle)
    return float(np.exp(high))


def _rounded(stage: Stage, factor: float) -> float:
    """Return about the same factor, so that the number which a user writes for it has two digits."""
    unit = stage.layers[0].transfer.unit
    return float(f"{factor:.2g}") if stage.scene.has_list else unit / float(f"{unit / factor:.2g}")


def _options(stage: Stage, factor: float) -> str:
    """Return the options that multiply all extinctions by a factor: a `unit`, or the weights of several volumes."""
    if stage.scene.has_list:
        weights = [f"{factor * layer.weight:.3g}" for layer in stage.scene.layers]
        return " ".join(f"--set volumes.{number}.weight={weight}" for number, weight in enumerate(weights))
    key, unit = next(iter(stage.scene.layers[0].look), "transfer_function"), stage.layers[0].transfer.unit
    return f"--set {key}.unit={unit / factor:.2g} (now {unit:.3g})"


def _reason(stage: Stage) -> str:
    """Return why a picture is dark whose matter is not thin, and the keys that make it brighter."""
    visible = [layer.transfer.colors[layer.transfer.extinctions > 0] for layer in stage.layers]
    are_bright = max((float(colors.max()) for colors in visible if colors.size), default=0.0) >= _BRIGHT_COLOR
    if are_bright and any(layer.spec.shading is not None for layer in stage.layers):
        keys = "a larger shading.ambient, or shading.light: camera,"
        return f"little light reaches the surfaces that are seen; {keys} makes it brighter"
    return "the colors of the values that are seen are dark; `hsplat info` lists the values that there are"
