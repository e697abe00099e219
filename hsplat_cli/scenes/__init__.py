"""Turns files and options into a `Job`.

In: a scene file, a sidecar, or a volume and options. Out: `Job`, which is a scene with its frames and its output; or a
suggested scene as text. Also declares the click options that several commands share.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
