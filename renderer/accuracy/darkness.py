"""Find out whether a picture is dark, and say why: thin matter, a light from elsewhere, or dark colors.

For thin matter the factor on all extinctions is solved by which the object holds back as much light as in a suggested
picture. The opacities that rays already have are enough for this: a factor on extinctions is one on optical depths.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from renderer.film import over_background
from renderer.frame import Stage
from renderer.scene import LayerSpec, join_words
from renderer.suggest import DEFAULT_COVERAGE
from renderer.volume import Float64

# A ray counts as meeting something visible if its opacity is above this: half a step of 8 bits.
_LEAST_OPACITY = 0.5 / 255
# The percentile of rays by which thin matter is judged: a few dense spots do not make it dense.
_PERCENTILE = 95.0
# The share of what is seen by which a picture is judged: a lit patch does not make it bright. Rays count by their
# opacities, so that a faint halo does not make a bright object dark.
_MOST = 0.75
# The same for projections, which have no light that could fail to reach matter. All of their rays are opaque, and those
# beside a small object may be black.
_MOST_OF_PROJECTION = 0.95
# A picture is dark if most of what is seen is darker than this, as a share of white. Suggested scenes of 15 scans with
# all presets have 0.52 and more, the gallery's scenes 0.43.
DARK = 0.15
# Matter is thin if even its most opaque rays lose less than this share of their light, or if it would be dark although
# it were white and evenly lit.
_THIN = 0.25
# A ray meets the object, and not a haze around it, if its opacity is more than this share of that of opaque rays.
_OF_OBJECT = 0.1
# The largest natural logarithm of a factor on extinctions that is looked for, and the number of halvings of the search.
_MAX_LOG_FACTOR = 20.0
_NUM_HALVINGS = 40
# Where to find the values whose colors count.
_INFO = "`hsplat info` lists the values that there are"


class Darkness(NamedTuple):
    """A reason why a picture is dark, with the keys that make it brighter: a part of a sentence.

    factor: the factor on all extinctions that makes thin matter visible; 1 if the matter is not thin.
    """

    why: str
    factor: float = 1.0


class DrawRays(Protocol):
    """A function that draws the rays of a picture again."""

    def __call__(self, factor: float = 1.0, *, is_even: bool = False) -> Float64:
        """Return the radiance of the rays with all extinctions multiplied by a factor.

        is_even: whether even light, in which every point shows its own color, replaces the shading.
        """


def brightness_of(stage: Stage, radiance: Float64) -> float:
    """Return the brightness which most of what is seen does not exceed, from 0 to 1.

    It is 1 against a light background, against which nothing is called dark, and where nothing is visible.

    radiance: of the picture's rays, [n, 4]; in a scene with `light`, of matter in even light, as exact rays have it.
    """
    background, is_linear = stage.scene.background, stage.scene.light is not None
    behind = over_background(np.zeros((1, 1, 4)), background, is_linear=is_linear)
    meets = radiance[radiance[:, 3] > _LEAST_OPACITY]
    if behind.max() > DARK or not meets.size:
        return 1.0
    brightness = over_background(meets[None], background, is_linear=is_linear)[0].max(axis=1)
    return _most_of(brightness, meets[:, 3], _MOST_OF_PROJECTION if stage.scene.mode.is_projection else _MOST)


def _most_of(values: Float64, opacities: Float64, share: float) -> float:
    """Return the value that a share of what is seen does not exceed. values, opacities: of rays, [n]."""
    order = np.argsort(values, kind="stable")
    seen = np.cumsum(opacities[order])
    return float(values[order][np.searchsorted(seen, share * seen[-1])])


def explain_darkness(stage: Stage, radiance: Float64, draw: DrawRays) -> Darkness:
    """Say why a picture is dark. radiance: as in `brightness_of`."""
    return explain_thinness(stage, radiance, draw) or Darkness(_reason(stage, radiance, draw(is_even=True)))


def explain_thinness(stage: Stage, radiance: Float64, draw: DrawRays) -> Darkness | None:
    """Say how thin the matter of a picture is; None if it is not thin, or if rays meet no matter.

    radiance: as in `brightness_of`.
    """
    opacities = radiance[:, 3]
    opacities = opacities[opacities > (_LEAST_OPACITY if opacities.max() > _LEAST_OPACITY else 0)]
    if not opacities.size:
        return None
    opacity = float(np.percentile(opacities, _PERCENTILE))
    if opacity >= _THIN and _most_of(opacities, opacities, _MOST) >= DARK:
        return None
    amount = f"matter holds back at most {100 * opacity:.2g} % of the light"
    if stage.scene.mode.is_projection:
        return Darkness(f"{amount}; higher opacities make it brighter")
    factor = _rounded(stage, _factor(opacities[opacities > _OF_OBJECT * opacity]))
    remedy = f"{amount}; with {_options(stage, factor)} it is"
    denser = draw(factor)
    if brightness_of(stage, denser) < DARK:
        return Darkness(f"{remedy} denser, but {_reason(stage, denser, draw(factor, is_even=True))}", factor)
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


def _reason(stage: Stage, radiance: Float64, even: Float64) -> str:
    """Return why a picture is dark whose matter is not thin, and the keys that make it brighter.

    even: the radiance of the same rays in even light.
    """
    light = "little light reaches the surfaces that are seen"
    more_light = "a larger shading.ambient, or shading.light: camera,"
    if brightness_of(stage, even) >= DARK:
        return f"{light}; {more_light} makes it brighter"
    colors = _color_keys(stage)
    if brightness_of(stage, _whitened(radiance, even)) < DARK:  # bright colors alone would not suffice
        return f"{light}, and their colors are dark; {more_light} and {colors} together make it brighter"
    return f"the colors of the values that are seen are dark; {colors} make it brighter: {_INFO}"


def _whitened(radiance: Float64, even: Float64) -> Float64:
    """Return the radiance of rays as if all matter were white: its light is the share of even light that it shows."""
    shown, of_color = radiance[:, :3].max(axis=1), even[:, :3].max(axis=1)
    light = np.divide(shown, of_color, out=np.ones_like(shown), where=of_color > 0)
    return np.column_stack([*[light * radiance[:, 3]] * 3, radiance[:, 3]])


def _color_keys(stage: Stage) -> str:
    """Return the keys of a scene that make the colors of visible matter brighter, in words."""
    keys: dict[str, list[str]] = {}
    for number, layer in enumerate(stage.layers):
        what, key = _color_key(layer.spec)
        if layer.pyramid.occupied.any():
            keys.setdefault(what, []).append(f"volumes.{number}.{key}" if stage.scene.has_list else key)
    return join_words([f"{what} {join_words(names, 'and')}" for what, names in keys.items()], "and")


def _color_key(spec: LayerSpec) -> tuple[str, str]:
    """Return the change that makes the colors of a volume brighter, and its key in the volume's entry."""
    if spec.color is not None:
        return "a brighter", "color"
    transfer = spec.transfer_function
    if transfer.labels is not None:
        return "brighter", "labels.colors"
    if transfer.points and transfer.imported is None:
        return "brighter colors in", "transfer_function.points"
    return "a narrower", "transfer_function.range"
