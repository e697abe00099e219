from .read import read_volume as read_volume, voxel_files as voxel_files
from .sniff import UnknownFormatError as UnknownFormatError, find_volume as find_volume
