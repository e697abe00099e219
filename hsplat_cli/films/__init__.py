"""Render a job to a film, resume or refine it, or assemble a film from parts.

In: a `Job` and an `ExecutorSpec`, or parts. Out: a `FilmResult`: its file, its sidecar and the records of its frames.
Unfinished films resume where they stopped. A film that is up to date is not drawn again.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
