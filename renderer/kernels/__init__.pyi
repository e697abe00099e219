from .binding import kernels as kernels
from .bus_errors import guarded_regions as guarded_regions
from .library import describe_kernels as describe_kernels, num_lanes as num_lanes, processor_level as processor_level
from .threads import ThreadPool as ThreadPool

# isort: split
# For tests alone: steps and constants that no other room uses.
from .binding import Kernel as Kernel
from .build import (
    BUILT as BUILT,
    LEVELS as LEVELS,
    SOURCES as SOURCES,
    source_files as source_files,
    this_target as this_target,
)
from .header import Header as Header, read_headers as read_headers
from .library import load_library as load_library
