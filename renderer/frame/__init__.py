"""One frame, step by step, and the budgets that choose its tolerance.

In: `FilmScene`. Out: `FilmStage` (layers, framing, camera path), and from it a `Stage` and a `Frame` for each frame
number: cut, sort, draw, round. A `ToleranceController` follows the schedule or a budget of seconds. `serialize_stage`
takes a stage to another process.

- `pipeline.py`: the table of contents, from a scene to its frames; `stage.py`: what a frame is drawn from, which all
  frames share where nothing moves; `preparation.py`: makes it, and reuses what has not changed since the frame before.
- `frame.py`: one frame; `primitives.py`: splats or bricks, and the level of detail at a tolerance: all that drawing,
  budgets and sweeps ask of a footprint.
- `budget.py`: the tolerance of a frame, by the schedule or by a budget of seconds.
- `transport.py`: a stage as bytes, for other processes.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
