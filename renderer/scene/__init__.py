"""The scene: what to render and how, frozen and checked.

In: YAML text or a parsed tree. Out: `Scene`, or one `SceneError` that lists every problem with its line and column.
Its field types also check sidecars and golden records. Importing it imports no numpy, so that `hsplat check` is fast.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
