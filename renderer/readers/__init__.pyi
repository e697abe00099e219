from .headers import metaimage_voxels as metaimage_voxels, nrrd_voxels as nrrd_voxels
from .read import read_volume as read_volume
from .sniff import UnknownFormatError as UnknownFormatError, require_volume_file as require_volume_file
