"""Errors against the truth, and what accuracy costs.

In: pictures, or a scene and a plan. Out: metrics (PSNR; SSIM, Wang et al. 2004; FLIP, Andersson et al. 2020), sweeps
over tolerances with their Pareto front, the tolerance that reaches an accuracy, and the limits by which golden frames
are compared.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
