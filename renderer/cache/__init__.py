"""Keep what was made of a volume in a folder that a person names, so that a later process need not make it again.

In: a kind of entry, the facts it was made from, and named arrays. Out: the same arrays, mapped from their files.
Nothing is kept without such a folder. Entries save time; results are the same without them.

- `cache_folder.py`: the folder of this process; entries, which are whole or missing, and which one process at a time
  makes; the least recently used one goes
- `kept_arrays.py`: entries with a digest, which are read into memory and compared with it
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
