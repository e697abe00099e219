"""Images to files, whole or not at all.

In: float images. Out: PNG frames, MP4 or GIF films and their sidecars. Files are staged and renamed; frames of an
unfinished film are kept beside it, and a lock keeps two jobs from writing the same film.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
