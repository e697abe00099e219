from .common import are_colors as are_colors
from .read import (
    header_and_voxel_files as header_and_voxel_files,
    mix_steps as mix_steps,
    num_steps as num_steps,
    read_volume as read_volume,
    time_steps as time_steps,
)
from .sniff import (
    TIFF_SUFFIXES as TIFF_SUFFIXES,
    UnknownFormatError as UnknownFormatError,
    find_volume as find_volume,
    is_dicom as is_dicom,
    is_volume_name as is_volume_name,
    slices_of_pictures as slices_of_pictures,
    volumes_in as volumes_in,
)
from .steps_in_time import TimeSteps as TimeSteps
