"""Open stores: images in chunks, with levels of resolution, in a folder, a ZIP archive or at a URL.

In: the path or the URL of a store. Out: its levels (shape, chunks, type, place in the world), axes, channels, labels
and notes; and the voxels of a box of a level.
Metadata are parsed here. The library tensorstore reads and decodes chunks. Nothing is ever written into a store.

- `store.py`: an open store with its levels, and the voxels of a box
- `store_files.py`: the metadata files of a store, with limits of their sizes, and where its arrays are
- `library.py`: tensorstore, with limits of its memory and its threads, and errors for its failures
- `levels.py`: the records that describe an image (axes, levels), and the interface of an open one, by which files of
  other rooms with levels are read, too
- `ome.py`: OME-NGFF (OME-Zarr) 0.1 to 0.6
- `transformations.py`: the coordinate transformations of OME-NGFF as matrices
- `plain_zarr.py`: arrays and groups of Zarr 2 and 3 without OME
- `n5.py`: N5, with the levels of N5 Viewer and Paintera
- `precomputed.py`: volumes of Neuroglancer (precomputed)
- `fields.py`: values of JSON, which may have any type
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
