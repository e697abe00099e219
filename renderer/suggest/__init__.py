"""Suggest a transfer function that shows what is in a volume.

In: a volume and its statistics. Out: `Suggestion`: the kind of data, and control points and opacities that show it.
Thresholds by Otsu 1979.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
