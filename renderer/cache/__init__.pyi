from .cache_folder import (
    CacheFolder as CacheFolder,
    cache_folder as cache_folder,
    caching_in as caching_in,
)
from .kept_arrays import NOT_KEPT as NOT_KEPT, KeptArrays as KeptArrays
