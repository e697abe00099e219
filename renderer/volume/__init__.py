"""Define a scalar volume and its place in the world.

In: voxels [z, y, x] and an affine. Out: `Volume`, read-only. Voxels of large files stay in their file
(`MappedFile`) and are read when they are used.

- `volume.py`: the voxels with their affine, and lengths and places in the world
- `channel.py`: the description of a component in a file
- `label.py`: the description of a label in a file
- `volume_level.py`: the facts about a level of resolution in a store
- `mask.py`: a mask, prepared for kernels
- `mapped_file.py`: voxels that stay in their file, and checks that it is unchanged
- `slabs.py`: passes over all voxels, by one thread or several, and their progress
- `kept_passes.py`: the results of passes, which a later process finds in the cache
- `fingerprint.py`: a digest of the voxels, computed when it is first asked for
- `truncation_guard.py`: a guard against mapped files that become shorter
- `connected_parts.py`: the connected parts of a grid of cells
- `arrays.py`: names for types of arrays, for all rooms, and reductions of blocks of arrays
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
