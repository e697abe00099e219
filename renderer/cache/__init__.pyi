from .cache_folder import (
    CacheFolder as CacheFolder,
    cache_folder as cache_folder,
    caching_in as caching_in,
    kept_bytes as kept_bytes,
)
from .kept_arrays import (
    NOT_KEPT as NOT_KEPT,
    KeptArrays as KeptArrays,
    numbers_from_array as numbers_from_array,
    numbers_to_array as numbers_to_array,
)
