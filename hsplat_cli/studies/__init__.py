"""Measure scenes and reproduce the paper.

`run_study` sweeps settings over one scene and writes a report; `print_tolerance` finds the tolerance for an accuracy.
`FigureRenderer` draws the figures of `hsplat paper`.

- `measure/`: `study.py` sweeps, and notes what is unexpected; `tolerance.py` finds the tolerance for `--want psnr=38`;
  `options.py` parses lists of settings.
- `paper/`: figures 1 to 6 are `footprints.py`, `opacity.py`, `one_splat.py`, `levels.py`, `octrees.py` and
  `refinement.py`; `figure.py` draws their scenes and describes a figure.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
