from .levels import (
    Axis as Axis,
    AxisKind as AxisKind,
    Box as Box,
    ImagePlan as ImagePlan,
    Level as Level,
    LevelPlan as LevelPlan,
    OpenImage as OpenImage,
    StoredImage as StoredImage,
    axis_named as axis_named,
    slabs_of as slabs_of,
)
from .store import Store as Store, open_store as open_store
from .store_files import is_store as is_store, is_zipped_store as is_zipped_store
