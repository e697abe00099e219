from .components import are_colors as are_colors
from .image import Image as Image
from .image_objects import is_image_object as is_image_object, read_object as read_object
from .kept_levels import looking_once as looking_once
from .overview import overview_level as overview_level
from .sniff import (
    TIFF_SUFFIXES as TIFF_SUFFIXES,
    UnknownFormatError as UnknownFormatError,
    find_volume as find_volume,
    is_dicom as is_dicom,
    is_volume_name as is_volume_name,
    masks_in as masks_in,
    natural_sort_key as natural_sort_key,
    series_of_slice as series_of_slice,
    slices_of_pictures as slices_of_pictures,
    volumes_in as volumes_in,
)
from .steps_in_time import some_steps as some_steps
from .store_blocks import Blocks as Blocks
from .volume_files import header_and_voxel_files as header_and_voxel_files
from .volume_reading import (
    ReadVolume as ReadVolume,
    mix_steps as mix_steps,
    most_level_bytes as most_level_bytes,
    read_part as read_part,
    read_volume as read_volume,
    state_of_store as state_of_store,
)

# isort: split
# For tests alone: steps and constants that no other room uses.
from .affines import check_lengths as check_lengths
from .dicom_tags import summarize as summarize
from .file_errors import errors_about as errors_about
from .isolation import call_reader as call_reader, read_isolated as read_isolated
from .kept_levels import find_marks as find_marks
from .nrrd import read_nrrd as read_nrrd
from .procedural import procedural_values as procedural_values
from .procedural_vessels import vessel_tree as vessel_tree
from .recent_images import ImageRequest as ImageRequest, RecentImages as RecentImages
from .statements import FormatTable as FormatTable, Statement as Statement
from .volume_reading import crop_image as crop_image
from .voxel_limits import check_memory as check_memory
