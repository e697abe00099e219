"""Measure scenes and reproduce the paper.

`run_study` sweeps settings over one scene and writes a report; `print_tolerance` finds the tolerance for an accuracy.
`FigureRenderer` draws the figures of `hsplat paper`. `peers/` measures VTK on the same scene.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
