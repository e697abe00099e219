"""Find the projection of a scene by the name of its mode."""

from __future__ import annotations

from renderer.modes.depth_averages import Attenuation, Mean
from renderer.modes.extremum import Extremum
from renderer.modes.projection import Projection
from renderer.scene import ModeSpec
from renderer.transfer import TransferFunction
from renderer.volume import Volume

# The classes of projections, by the names of modes.
_PROJECTIONS: dict[str, type[Projection]] = {
    "maximum": Extremum,
    "minimum": Extremum,
    "mean": Mean,
    "attenuation": Attenuation,
}


def make_projection(spec: ModeSpec, colors: TransferFunction, volume: Volume) -> Projection | None:
    """Return the projection of a mode; None for the mode of emission and absorption.

    colors: the scene's transfer function, of which projections use the colours only.
    """
    kind = _PROJECTIONS.get(spec.type)
    return None if kind is None else kind(spec, colors, volume)
