"""Files and options to a `Job`.

In: a scene file, a sidecar, or a volume and options. Out: `Job`: a scene, its frames and its output; or a suggested
scene as text.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
