"""Find out whether a picture is too bright, so that its shades are lost, and say which keys make it darker."""

from __future__ import annotations

import numpy as np

from renderer.frame import Stage
from renderer.volume import Float64

# A ray counts as meeting something visible if its opacity is above this: half a step of 8 bits.
_LEAST_OPACITY = 0.5 / 255
# A color is overexposed if a channel is larger than this: white, and half a step of 8 bits. The picture shows white.
_WHITE = 1 + 0.5 / 255
# A picture is too bright if at least this share of the rays that meet something visible are overexposed. Of 11
# scenes in `configs`, the one whose light adds up has 0.16, the others have 0; a suggested scan has 0.006.
_LEAST_SHARE = 0.5


def overexposed_share(radiance: Float64) -> float:
    """Return the share of overexposed rays among those that meet something visible.

    radiance: of a picture's rays, [n, 4]; in a scene with `light`, of matter in even light, which is never overexposed.
    """
    meets = radiance[:, 3] > _LEAST_OPACITY
    return float((radiance[meets, :3].max(axis=1) > _WHITE).mean()) if meets.any() else 0.0


def overexposure_note(stage: Stage, shares: list[float]) -> str:
    """Return a sentence on a film that is too bright, without its full stop; empty if it is not.

    shares: the overexposed shares of some of its frames.
    """
    share = float(np.median(shares))
    if share < _LEAST_SHARE:
        return ""
    add_up = stage.scene.blend == "add" and len(stage.layers) > 1
    remedy = "a smaller weight makes" if add_up else "smaller shading.ambient, shading.diffuse or shading.specular make"
    lost = f"{100 * share:.2g} % of what is seen has more light than white, and loses its shades"
    return f"the picture is too bright: {lost}; {remedy} it darker"
