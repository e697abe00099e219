"""Choose an environment and a key light for a suggested film, in which matter scatters light."""

from __future__ import annotations

from dataclasses import replace

from renderer.scene import ENVIRONMENTS, KeySpec, LightSpec
from renderer.suggest.palette import in_8_bits
from renderer.suggest.suggestion import Suggestion

# The key light above and in front, on the side that a turntable shows first, as the lamp of SHADING.
_FROM_ABOVE = (0.5, -0.8, 1.0)
# The key light of each environment: a large warm lamp, the sun, or none below clouds.
_KEYS: dict[str, KeySpec | None] = {
    "studio": KeySpec(_FROM_ABOVE, color=in_8_bits((1.0, 0.95, 0.88)), strength=2.5, radius=12.0),
    "outdoor": KeySpec(_FROM_ABOVE, color=in_8_bits((1.0, 0.93, 0.81)), strength=3.0, radius=4.0),
    "overcast": None,
}
# The share of a point that is a surface. Matter alone looks like wax, surfaces alone like chalk.
_SURFACE = 0.9
# The coefficient of highlights on surfaces.
_SPECULAR = 0.3


def with_light(suggestion: Suggestion, environment: str) -> Suggestion:
    """Return the suggestion in the light of an environment, in place of its shading.

    environment: a name of ENVIRONMENTS. Data without surfaces only scatter light.
    """
    key = _KEYS[environment]
    light = LightSpec(ENVIRONMENTS[environment], key=key)
    if suggestion.shading is not None:
        light = replace(light, surface=_SURFACE, specular=0.0 if key is None else _SPECULAR)
    return replace(suggestion, shading=None, light=light)
