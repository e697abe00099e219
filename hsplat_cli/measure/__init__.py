"""Measures the cost and the accuracy of a scene at many settings.

In: a scene, and the settings to draw it at. Out: cost and accuracy of each setting, with the Pareto front, as a page,
CSV, JSON and a table for the terminal; or the tolerance that reaches an accuracy.

- `sweep_options.py`: lists of settings on the command line; `study.py`: one scene at all of them, and its notes;
  `sweep.py`: cost and accuracy of a setting, and the record of a study; `thumbnails.py`: small pictures.
- `pareto.py`: the settings that no other setting beats; `costs.py`: the cost of a PSNR on this front.
- `report.py` makes and writes the report; `plots.py`: its charts of error against cost; `tables.py`: text, CSV and
  JSON, and the columns of the page.
- `tolerance.py` finds the tolerance for `--want psnr=38`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
