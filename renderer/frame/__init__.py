"""Draw one frame, step by step, at a tolerance that its schedule or its budget chooses.

In: `FilmScene`. Out: `FilmStage` (layers, framing, camera path), and from it a `Stage` and a `Frame` for each frame
number: cut, sort, draw, round. A `ToleranceController` follows the schedule or a budget of seconds. `serialize_stage`
turns a stage into bytes for another process.

- `pipeline.py`: the table of contents, from a scene to its frames
- `stage.py`: the data that a film and a frame are drawn from
- `camera_framing.py`: the camera's target and distance, and the object's place beside the annotation
- `preparation.py`: stages, made for each frame from all that has not changed since the frame before
- `frame.py`: one frame, sorted and drawn
- `primitives.py`: splats or bricks, as levels of detail at a tolerance
- `film_annotation.py`: the annotation of a film: a test that pictures have room for it, and the drawing
- `budget.py`: the tolerance of a frame, by the schedule or by a budget of seconds
- `transport.py`: a stage as bytes, for other processes
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
