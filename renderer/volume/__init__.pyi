from .arrays import (
    Array as Array,
    Bools as Bools,
    Float32 as Float32,
    Float64 as Float64,
    Int32 as Int32,
    Int64 as Int64,
    UInt8 as UInt8,
    UInt32 as UInt32,
    UInt64 as UInt64,
    reduce_blocks as reduce_blocks,
)
from .channel import Channel as Channel
from .connected_parts import grow as grow, label_parts as label_parts
from .fingerprint import Fingerprint as Fingerprint
from .kept_passes import kept_numbers as kept_numbers, kept_pass as kept_pass
from .label import Label as Label
from .mapped_file import (
    MappedFile as MappedFile,
    backing_file as backing_file,
)
from .mask import meet_mask as meet_mask
from .slabs import (
    iter_slabs as iter_slabs,
    map_slabs as map_slabs,
    tell_pass as tell_pass,
    watched_passes as watched_passes,
)
from .truncation_guard import guard_mapping as guard_mapping
from .volume import (
    Volume as Volume,
    joint_fingerprint as joint_fingerprint,
    make_volume as make_volume,
    move_volume as move_volume,
    sampled_volume as sampled_volume,
)
from .volume_level import VolumeLevel as VolumeLevel
