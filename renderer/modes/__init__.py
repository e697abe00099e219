"""What a ray shows of the field that it passes: one file for each kind of projection.

In: a scene's `ModeSpec`, its colours, and the volume. Out: a `Projection`, which says what is drawn in place of the
scene's transfer function, and turns what rays gathered into colours. Emission and absorption have none.

- `projection.py`: what projections have in common; `table.py`: all of them by name.
- `extremum.py`: the largest or smallest scalar of a ray, and where it is; `depth_averages.py`: mean and attenuation,
  which are optical depths of other transfer functions.
- `chords.py`: the lengths of rays inside the volume's box.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
