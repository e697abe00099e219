from .cache_folder import (
    CacheFolder as CacheFolder,
    cache_folder as cache_folder,
    caching_in as caching_in,
)
