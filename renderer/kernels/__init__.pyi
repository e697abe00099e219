from .binding import kernels as kernels
from .library import num_lanes as num_lanes, processor_level as processor_level
