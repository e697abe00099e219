"""Errors against the truth, and what accuracy costs.

In: pictures, or a scene. Out: metrics (PSNR; SSIM, Wang et al. 2004; FLIP, Andersson et al. 2020), sweeps
over tolerances with their Pareto front, the tolerance that reaches an accuracy, and the limits by which golden frames
are compared.

- `metrics.py`: RMSE, PSNR, SSIM, FLIP, Delta-E. `truths.py`: the truth of a frame, or of some of its pixels.
- `thumbnails.py`: small pictures.
- `tolerance_search.py`: the tolerance for an accuracy, by whole exact pictures; `film_tolerances.py`: those along a
  film, by a few exact rays.
- `sweep.py`: cost and accuracy of many settings, and the record of a study; `pareto.py`: those that no other beats.
- `comparison.py`: the errors of a picture against its golden frame; `strictness.py`: named limits of these errors, and
  what exceeds them.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
