"""One frame, step by step, and the budgets that choose its tolerance.

In: `Scene`. Out: `Stage` (volume, pyramid, camera path), and from it a `Frame` for each frame number: cut, sort, draw,
round. A `ToleranceController` follows the schedule or a budget of seconds. `serialize_stage` takes a stage to another
process.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
