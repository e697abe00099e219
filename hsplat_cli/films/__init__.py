"""Render a job to a film, resume or refine it, or assemble a film from parts.

In: a `Job` and an `ExecutorSpec`, or parts. Out: a `FilmResult`: its file and its sidecar.
Unfinished films resume where they stopped. A film that is up to date is not drawn again.

- `render.py`: the one loop over passes and frames; `progressive.py`: passes that refine; `background.py`: frames are
  encoded while the next one is drawn; `film.py`: the result.
- `resume.py`: up to date, or frames to resume from; `fingerprint.py`: what frames depend on.
- `goals.py`: the tolerances for what a scene asks for, found before frames are drawn; `accuracy.py`: those for an
  accuracy.
- `sidecar_record.py`: the content of the sidecar.
- `assemble/`: one film of parts: `parts.py` finds and checks them, `agreement.py` compares them, `assembly.py` writes
  the film, `merged_sidecar.py` its sidecar.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
