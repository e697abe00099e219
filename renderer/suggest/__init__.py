"""A transfer function that suits a volume.

In: a volume's histogram, background, noise and edges. Out: `Suggestion`: the kind of data, control points and opacities
that show what is inside. Thresholds by Otsu 1979.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
