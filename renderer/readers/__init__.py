"""Read volume files: one reader for each family of formats.

In: a `VolumeSpec`. Out: `Volume`, cropped, checked and finite, in LPS world coordinates where the format has them.
Headers are checked before a library reads them and before memory is allocated.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
