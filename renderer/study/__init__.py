"""What accuracy costs, and how a picture differs from its golden frame.

In: a scene with its truths, or two pictures. Out: sweeps over tolerances with their Pareto front, and the limits by
which golden frames are compared.

- `sweep.py`: cost and accuracy of many settings, and the record of a study; `pareto.py`: those that no other beats.
- `thumbnails.py`: small pictures.
- `comparison.py`: the errors of a picture against its golden frame; `strictness.py`: named limits of these errors, and
  what exceeds them.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
