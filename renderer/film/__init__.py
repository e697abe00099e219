"""Write pictures to files, whole or not at all, and read films back.

In: float images. Out: frames in files, films, and the pictures of finished films. `open_films` writes all files of a
drawing under temporary names and renames them at the end. `locked_output` keeps two jobs from writing the same film.

- `writer.py`: finished frames written to films and numbered files
- `encode.py`: films by ffmpeg, with its filters and codecs
- `stream_tail.py`: the end of ffmpeg's messages
- `decode.py`: the pictures of a film
- `quantization.py`: float images over a background, rounded to whole numbers
- `picture.py`: a finished frame, as pixels or as a file
- `png.py`, `exr.py`: the formats of files with one picture
- `atomic.py`: files under temporary names, renamed at the end
- `names.py`: the names of frames, sidecars and folders for unfinished work
- `lock.py`: locks by which one job at a time writes an output
- `runs.py`: consecutive frames as ranges
- `digests.py`: digests of files and records
- `written_files.py`: the list of all files that a job writes; refuses outputs that would replace an input
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
