"""One frame, step by step, and the budgets that choose its tolerance.

In: `Scene`. Out: `Stage` (volume, pyramid, camera path), and from it a `Frame` for each frame number:
cut, project, sort, draw. `BudgetController` keeps a number of cells or of seconds.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
