from .components import are_colors as are_colors
from .sniff import (
    TIFF_SUFFIXES as TIFF_SUFFIXES,
    UnknownFormatError as UnknownFormatError,
    find_volume as find_volume,
    is_dicom as is_dicom,
    is_volume_name as is_volume_name,
    natural_sort_key as natural_sort_key,
    series_of_slice as series_of_slice,
    slices_of_pictures as slices_of_pictures,
    volumes_in as volumes_in,
)
from .steps_in_time import some_steps as some_steps
from .volume_reading import (
    ReadVolume as ReadVolume,
    header_and_voxel_files as header_and_voxel_files,
    mix_steps as mix_steps,
    read_volume as read_volume,
)
