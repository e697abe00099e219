from .levels import Axis as Axis, Level as Level, StoredImage as StoredImage
from .store import Store as Store, open_store as open_store
from .store_files import is_store as is_store, is_zipped_store as is_zipped_store
