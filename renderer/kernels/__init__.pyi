from .binding import kernels as kernels
from .library import describe_kernels as describe_kernels, num_lanes as num_lanes, processor_level as processor_level
