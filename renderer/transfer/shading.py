"""Lambert's law on the gradient of the field: what shading multiplies a colour by."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from renderer.jit import fma, jit
from renderer.scene import ShadingSpec

Float64 = npt.NDArray[np.float64]


def toward_light(shading: ShadingSpec) -> Float64:
    """Return the unit vector towards the light, in world axes, float64 [3]."""
    light = np.array(shading.light, np.float64)
    return np.asarray(light / np.linalg.norm(light))


@jit
def lambert_factor(x: Any, y: Any, z: Any, light: tuple[Any, ...]) -> Any:
    """Return `ambient + diffuse max(0, n . l)`, with the normal n against the world gradient (x, y, z).

    The gradient's largest component is about 1, so that squares neither overflow nor vanish. In the precision of the
    arguments, float32 or float64. light: the vector l towards the light, ambient, diffuse.
    """
    across = fma(x, light[0], fma(y, light[1], z * light[2]))
    length = np.sqrt(fma(x, x, fma(y, y, z * z)))
    return fma(light[4], max(np.float32(0.0), -across / length), light[3])
