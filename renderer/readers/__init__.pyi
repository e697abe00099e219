from .read import data_files as data_files, read_volume as read_volume
from .sniff import UnknownFormatError as UnknownFormatError, find_volume as find_volume
