from .binding import kernels as kernels
from .bus_errors import guarded_regions as guarded_regions
from .library import describe_kernels as describe_kernels, num_lanes as num_lanes, processor_level as processor_level
from .threads import ThreadPool as ThreadPool
