"""A scalar volume and its place in the world.

In: voxels [z, y, x] and an affine. Out: `Volume`, read-only. Voxels of large files stay in their file
(`MappedFile`) and are read when they are used.

- `volume.py`: the voxels and their affine; spacing, centre and corners in the world.
- `channel.py`: what a file tells of one of its components; `label.py`: of the voxels with one value.
- `mask.py`: where another volume shows one.
- `mapped_file.py`: voxels that stay in their file; `truncation_guard.py`: files that become shorter meanwhile.
- `connected_parts.py`: the connected parts of a grid of cells.
- `arrays.py`: names for types of arrays, for all rooms; what blocks of arrays reduce to.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
