"""Measure scenes.

`run_study` sweeps settings over one scene and writes a report; `print_tolerance` finds the tolerance for an accuracy.

- `measure/`: `study.py` sweeps, and notes what is unexpected; `tolerance.py` finds the tolerance for `--want psnr=38`;
  `options.py` parses lists of settings.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
