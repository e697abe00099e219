from . import schema as schema
from .annotation_section import (
    AnnotationSpec as AnnotationSpec,
    ColorBarSpec as ColorBarSpec,
    EntrySpec as EntrySpec,
    LogoSpec as LogoSpec,
    NamesSpec as NamesSpec,
    TimeSpec as TimeSpec,
    TitleSpec as TitleSpec,
    fill_format as fill_format,
    moving_numbers as moving_numbers,
)
from .camera_section import (
    AXES as AXES,
    CAMERA_FIELD as CAMERA_FIELD,
    CameraPath as CameraPath,
    CameraSpec as CameraSpec,
    FlightKey as FlightKey,
    FlightPath as FlightPath,
    HoldPath as HoldPath,
    Keyframe as Keyframe,
    KeyframePath as KeyframePath,
    PathPiece as PathPiece,
    PathSequence as PathSequence,
    RockerPath as RockerPath,
    TurntablePath as TurntablePath,
)
from .clip_section import MAX_CLIPS as MAX_CLIPS, ClipSpec as ClipSpec, PlaneSpec as PlaneSpec
from .colormaps import (
    colormap_points as colormap_points,
)
from .error_section import (
    ERROR_SECTION as ERROR_SECTION,
    MAX_LEVEL as MAX_LEVEL,
    MAX_PSNR_DB as MAX_PSNR_DB,
    MIN_TOLERANCE as MIN_TOLERANCE,
    TOLERANCE_FIELD as TOLERANCE_FIELD,
    ErrorSpec as ErrorSpec,
    MetricTarget as MetricTarget,
    SplatBudget as SplatBudget,
    TimeBudget as TimeBudget,
    schedule_to_dict as schedule_to_dict,
)
from .file_places import found_path as found_path, relative_path as relative_path, with_files as with_files
from .fog_section import FogSpec as FogSpec
from .input_file import (
    MAX_SCENE_BYTES as MAX_SCENE_BYTES,
    MAX_SIDECAR_BYTES as MAX_SIDECAR_BYTES,
    decode_utf8 as decode_utf8,
    is_same_file as is_same_file,
    may_be_json as may_be_json,
    missing_file_error as missing_file_error,
    nearest_file_hint as nearest_file_hint,
    place_name as place_name,
    place_of as place_of,
    read_bounded as read_bounded,
    read_content as read_content,
    read_json_object as read_json_object,
    require_file as require_file,
)
from .json_tree import is_plain_data as is_plain_data, load_json_object as load_json_object
from .key_explanation import (
    SCHEMA_COMMENT as SCHEMA_COMMENT,
    explain_key as explain_key,
    scene_keys as scene_keys,
    scene_schema as scene_schema,
)
from .labels_section import (
    MAX_LABEL as MAX_LABEL,
    MAX_LABELS as MAX_LABELS,
    LabelKey as LabelKey,
    LabelsSpec as LabelsSpec,
    LabelStyle as LabelStyle,
    MaskSpec as MaskSpec,
)
from .layers_section import (
    OPEN_LOOK as OPEN_LOOK,
    RAMP_THICKNESS as RAMP_THICKNESS,
    LayerSpec as LayerSpec,
    SharedKeys as SharedKeys,
    ramp as ramp,
)
from .level_choice import LevelChoice as LevelChoice
from .light_section import (
    ENVIRONMENTS as ENVIRONMENTS,
    EnvironmentSpec as EnvironmentSpec,
    KeySpec as KeySpec,
    LightSpec as LightSpec,
    SurfaceSpec as SurfaceSpec,
    chosen_exposure_text as chosen_exposure_text,
)
from .limits import (
    camera_problems as camera_problems,
    raise_problems as raise_problems,
    volume_extent as volume_extent,
    volume_problems as volume_problems,
)
from .message_text import (
    counted as counted,
    did_you_mean as did_you_mean,
    first_few as first_few,
    format_value as format_value,
    join_keys as join_keys,
    join_some as join_some,
    join_words as join_words,
    pluralize_range as pluralize_range,
    short_text as short_text,
)
from .mode_section import MODE_NAMES as MODE_NAMES, ModeSpec as ModeSpec
from .motion import (
    Motion as Motion,
    OverFrames as OverFrames,
    moving as moving,
    moving_result as moving_result,
    value_at as value_at,
)
from .output_formats import (
    FILM_SUFFIXES as FILM_SUFFIXES,
    FORMATS as FORMATS,
    FRAME_SUFFIXES as FRAME_SUFFIXES,
    Codec as Codec,
    format_of as format_of,
    output_suffix as output_suffix,
)
from .output_section import (
    FRAME_FIELD as FRAME_FIELD,
    MAX_QUALITY as MAX_QUALITY,
    OUTPUT_FILE_FIELD as OUTPUT_FILE_FIELD,
    OUTPUT_SECTION as OUTPUT_SECTION,
    OutputFile as OutputFile,
    OutputSpec as OutputSpec,
    first_output as first_output,
    only_output as only_output,
    outputs_of as outputs_of,
)
from .picture_kind import Background as Background, PictureKind as PictureKind
from .scene_file import (
    TreeEditor as TreeEditor,
    edit_scene_content as edit_scene_content,
    load_scene as load_scene,
    parse_scene_content as parse_scene_content,
)
from .scene_reading import parse_scene as parse_scene
from .scene_writing import (
    moving_values as moving_values,
    scene_to_dict as scene_to_dict,
    spec_to_dict as spec_to_dict,
    without_sources as without_sources,
)
from .schedule import (
    accuracy_of as accuracy_of,
    is_film_wide_goal as is_film_wide_goal,
    min_tolerance as min_tolerance,
    schedule_from_tolerances as schedule_from_tolerances,
    tolerance_at as tolerance_at,
    with_draw_order as with_draw_order,
    with_tolerance as with_tolerance,
    with_tolerances as with_tolerances,
)
from .schema import (
    FRAME_NUMBER_FIELD as FRAME_NUMBER_FIELD,
    MAX_FRAMES as MAX_FRAMES,
    MAX_WORLD_LENGTH as MAX_WORLD_LENGTH,
    MIN_WORLD_LENGTH as MIN_WORLD_LENGTH,
    TILDE_HINT as TILDE_HINT,
    Color as Color,
    Vector as Vector,
    check_frame_in_path as check_frame_in_path,
    check_frames_ascend as check_frames_ascend,
    has_unexpanded_tilde as has_unexpanded_tilde,
)
from .shading_section import FACE_DEPTH as FACE_DEPTH, ShadingSpec as ShadingSpec
from .spec import (
    SECTIONS as SECTIONS,
    AnyScene as AnyScene,
    FilmScene as FilmScene,
    PyramidSpec as PyramidSpec,
    Scene as Scene,
)
from .splat_section import SplatSpec as SplatSpec
from .transfer_section import (
    COLORMAP_FIELD as COLORMAP_FIELD,
    TRANSFER_FUNCTION_SECTION as TRANSFER_FUNCTION_SECTION,
    ColormapSpec as ColormapSpec,
    ControlPoint as ControlPoint,
    ImportedLook as ImportedLook,
    TransferSpec as TransferSpec,
    map_values as map_values,
)
from .urls import is_url as is_url, path_or_url as path_or_url
from .volume_files import (
    SOURCE_FIELD as SOURCE_FIELD,
    VOLUME_SUFFIXES as VOLUME_SUFFIXES,
    FileSource as FileSource,
    UrlSource as UrlSource,
    file_source as file_source,
    has_steps_in_time as has_steps_in_time,
    is_pattern as is_pattern,
)
from .volume_section import (
    SUBSET_INDEX_FIELD as SUBSET_INDEX_FIELD,
    VolumeSpec as VolumeSpec,
    is_unit as is_unit,
    steps_in_time as steps_in_time,
)
from .volume_sources import (
    PROCEDURAL_NAMES as PROCEDURAL_NAMES,
    ArraySource as ArraySource,
    ProceduralSource as ProceduralSource,
    RawSource as RawSource,
)
from .yaml_tree import (
    MAX_DEPTH as MAX_DEPTH,
    NotYamlError as NotYamlError,
    TextPosition as TextPosition,
    YamlTree as YamlTree,
    dump_yaml as dump_yaml,
    format_location as format_location,
    parse_yaml as parse_yaml,
    parse_yaml_file as parse_yaml_file,
)

# isort: split
# For tests alone: steps and constants that no other room uses.
from .camera_section import (
    MAX_FIELD_OF_VIEW as MAX_FIELD_OF_VIEW,
    MAX_ZOOM as MAX_ZOOM,
    MIN_FIELD_OF_VIEW as MIN_FIELD_OF_VIEW,
    PATH_EXAMPLES as PATH_EXAMPLES,
)
from .colormaps import is_colormap as is_colormap, nearest_colormap as nearest_colormap
from .motion import EASINGS as EASINGS, MotionKind as MotionKind, values_at as values_at
from .picture_size import MAX_SIDE as MAX_SIDE
from .tree_node import read_frame as read_frame
