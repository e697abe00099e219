from .mapped_file import MappedFile as MappedFile, OnMapped as OnMapped, file_behind as file_behind, slabs as slabs
from .volume import Array as Array, Float64 as Float64, Volume as Volume, make_volume as make_volume
