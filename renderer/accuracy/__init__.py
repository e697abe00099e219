"""Measure how exact pictures are, and find the tolerances at which they are as exact as wanted.

In: a stage, and frames that are drawn. Out: metrics against whole exact pictures (PSNR; SSIM, Wang et al. 2004; FLIP,
Andersson et al. 2020), or an estimate from a few exact rays, with an interval; tolerances. Pictures depend on this room
only if the scene asks for an accuracy.

- `pixels.py`: the choice of the pixels that get exact rays; `pixel_truths.py`: their exact colours, by rays or by paths
  of light; `prober.py`: the number of probes of a frame, and their errors; `estimate.py`: the estimate and its
  interval; `decibels.py`: from errors to decibels and back.
- `visibility.py`: the ranges of scalars whose share of the picture is recorded; `glance.py`: the faults of the pictures
  of a film before it is drawn; `darkness.py`: why a picture is dark; `overexposure.py`: whether it is too bright.
- `truths.py`: the exact picture of a frame, or of some of its pixels; `metrics.py`: RMSE, PSNR, SSIM, FLIP, Delta-E.
- `flicker.py`: how much errors change from frame to frame, by whole pictures; `shared_probes.py`: the same by probes.
- `search.py`: the coarsest tolerances for a wanted accuracy; `tolerances.py`: the tolerances that are worth trying;
  `references.py`: the exact rays or pictures with which trial pictures are compared.
- `encoding.py`: the loss of the encoder of a film; `file_errors.py`: the error that it adds to that of drawing.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
