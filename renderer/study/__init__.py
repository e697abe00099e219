"""Errors against the truth, and what accuracy costs.

In: pictures, or a scene and a plan. Out: metrics (PSNR; SSIM, Wang et al. 2004; FLIP, Andersson et al. 2020), sweeps
over tolerances with their Pareto front, the tolerance that reaches an accuracy, and the limits by which golden frames
are compared.

- `metrics.py`: RMSE, PSNR, SSIM, FLIP, Delta-E. `truths.py`: the truth of a frame. `thumbnails.py`: small pictures.
- `plan.py`: the tolerance of each frame, from any goal of a scene; `tolerance_search.py`: the one for an accuracy.
- `sweep.py`: cost and accuracy of many settings, and the record of a study; `pareto.py`: those that no other beats.
- `comparison.py`: a picture and its golden frame: errors, limits, and what exceeds them.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
