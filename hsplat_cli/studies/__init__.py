"""Measurements as commands: accuracy against cost, the paper's figures, another renderer.

In: a scene and a plan. Out: pages, CSV and JSON of `hsplat measure` and `hsplat paper`; VTK's pictures of the same
scene.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
