"""Accuracy from a few exact rays: what a frame, or a film, is known to have.

In: a stage, and frames that are drawn. Out: an estimate of the mean squared error against the converged ray integral,
with an interval. Nothing that is drawn depends on it.

- `pixels.py`: which pixels get a ray; `prober.py`: their errors; `estimate.py`: the estimate and its interval.
- `visibility.py`: the ranges of scalars whose share of the picture is recorded.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
