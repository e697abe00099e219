"""Scalar to colour and extinction.

In: control points or a colormap. Out: `TransferFunction`, and `Classifier` for compiled loops. Emission and absorption
by Max 1995: tau = -log1p(-opacity) / unit; means are of tau c and tau (Wittenbrink et al. 1998).
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
