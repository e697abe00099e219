"""Pictures to files, whole or not at all.

In: float images. Out: PNG frames, MP4 or GIF films, and the pictures of finished films. `open_film` writes a film under
temporary names and renames it at the end, and `locked_output` keeps two jobs from writing the same film.

- `writer.py`: frames to a film; `encode.py`: ffmpeg with its codec and bit rate; `stream_tail.py`: what ffmpeg prints.
- `decode.py`: a film back to pictures.
- `quantization.py`: float to 8 bits; `picture.py`: a finished frame; `png.py`: PNG files.
- `atomic.py`: temporary names, renamed at the end; `names.py`: the names of frames and files; `lock.py`: one job at a
  time; `runs.py`: consecutive frames as ranges; `digests.py`: whether a file is still the same.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
