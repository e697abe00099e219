"""Define the projections: modes in which a ray shows one number of the field, such as the maximum.

In: a scene's `ModeSpec`, its colours, and the volume. Out: a `Projection`, with the transfer function that is drawn in
place of the scene's, and the colours for the numbers of rays. Emission and absorption have no projection.

- `projection.py`: the base class of projections
- `table.py`: the classes of projections, by the names of modes
- `extremum.py`: the largest or smallest scalar of a ray, or its depth
- `depth_averages.py`: the mean scalar of a ray and its attenuation, both found from an optical depth
- `chords.py`: the lengths of rays inside the volume's box
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
