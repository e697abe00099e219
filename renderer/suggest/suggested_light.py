"""Choose an environment and a key light for a suggested film, in which matter scatters light."""

from __future__ import annotations

from dataclasses import replace

from renderer.scene import ENVIRONMENTS, KeySpec, LightSpec
from renderer.suggest.palette import in_8_bits
from renderer.suggest.suggestion import Suggestion

# The key light of each environment, on the side that a turntable shows first: a large warm lamp above and in front, as
# the lamp of SHADING; the sun from the side, so that shadows are seen; and a wide bright part of the clouds above, as
# under an even sky alone nothing has a shape.
_KEYS = {
    "studio": KeySpec((0.5, -0.8, 1.0), color=in_8_bits((1.0, 0.95, 0.88)), strength=2.5, radius=12.0),
    "outdoor": KeySpec((1.0, -0.6, 0.8), color=in_8_bits((1.0, 0.93, 0.81)), strength=4.0, radius=4.0),
    "overcast": KeySpec((0.2, -0.4, 1.0), strength=0.8, radius=40.0),
}
# The coefficient of highlights on surfaces. Clouds are too wide for highlights.
_SPECULAR = {"studio": 0.3, "outdoor": 0.3, "overcast": 0.0}
# The share of a point that is a surface. Matter alone looks like wax, surfaces alone like chalk.
_SURFACE = 0.9


def with_light(suggestion: Suggestion, environment: str) -> Suggestion:
    """Return the suggestion in the light of an environment, in place of its shading.

    environment: a name of ENVIRONMENTS. Data without surfaces only scatter light.
    """
    light = LightSpec(ENVIRONMENTS[environment], key=_KEYS[environment])
    if suggestion.shading is not None:
        light = replace(light, surface=_SURFACE, specular=_SPECULAR[environment])
    return replace(suggestion, shading=None, light=light)
