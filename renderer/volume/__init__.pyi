from .mapped_file import (
    Array as Array,
    MappedCallback as MappedCallback,
    MappedFile as MappedFile,
    backing_file as backing_file,
    iter_slabs as iter_slabs,
)
from .volume import Float64 as Float64, Volume as Volume, make_volume as make_volume
