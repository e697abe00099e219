"""Images to files, whole or not at all.

In: float images. Out: PNG frames, MP4 or GIF films and their sidecars. `open_film` writes a film under temporary names
and renames it at the end. `FrameCheckpoint` keeps finished frames of an unfinished film, from which a job resumes, and
`locked_output` keeps two jobs from writing the same film.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
