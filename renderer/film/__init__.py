"""Pictures to files, whole or not at all.

In: float images. Out: frames in files, films, and the pictures of finished films. `open_films` writes all files of a
drawing under temporary names and renames them at the end. `locked_output` keeps two jobs from writing the same film.

- `writer.py`: frames to films; `encode.py`: ffmpeg with its filters and codec; `stream_tail.py`: what ffmpeg prints.
- `decode.py`: a film back to pictures.
- `quantization.py`: float to whole numbers; `picture.py`: a finished frame; `png.py`, `exr.py`: its files.
- `atomic.py`: temporary names, renamed at the end; `names.py`: the names of frames and files; `lock.py`: one job at a
  time; `runs.py`: consecutive frames as ranges; `digests.py`: whether a file is still the same.
- `written_files.py`: the list of all files that a job writes, and what they may not be.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
