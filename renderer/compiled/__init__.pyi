from .compiler import fma as fma, inline as inline, jit as jit, prefetch as prefetch
from .kernel_cache import (
    cache_problem as cache_problem,
    has_cached_kernels as has_cached_kernels,
    remove_unused_caches as remove_unused_caches,
)
from .lanes import (
    Lanes as Lanes,
    any_of as any_of,
    append as append,
    bits_to_float32 as bits_to_float32,
    broadcast as broadcast,
    float32_to_bits as float32_to_bits,
    gather as gather,
    lane_numbers as lane_numbers,
    load as load,
    load_corners as load_corners,
    load_rows as load_rows,
    num_lanes as num_lanes,
    permute as permute,
    store as store,
    store_rows as store_rows,
    to_float32 as to_float32,
    to_float64 as to_float64,
    to_int32 as to_int32,
    where as where,
)
