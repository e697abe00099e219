from .colormaps import (
    colormap_points as colormap_points,
    is_colormap as is_colormap,
    nearest_colormap as nearest_colormap,
)
from .editor import Editor as Editor
from .input_file import (
    MAX_SCENE_BYTES as MAX_SCENE_BYTES,
    MAX_SIDECAR_BYTES as MAX_SIDECAR_BYTES,
    decode as decode,
    is_same_file as is_same_file,
    may_be_json as may_be_json,
    nearest_file_hint as nearest_file_hint,
    read_content as read_content,
)
from .limits import (
    camera_problems as camera_problems,
    extent_of as extent_of,
    raise_problems as raise_problems,
    volume_problems as volume_problems,
)
from .metric_target import Want as Want
from .parse import (
    scene_to_dict as scene_to_dict,
    schedule_to_dict as schedule_to_dict,
    splat_section_without_defaults as splat_section_without_defaults,
)
from .parse_camera import FRAME_NUMBER as FRAME_NUMBER, MAX_FRAMES as MAX_FRAMES
from .parse_error_schedule import ERROR as ERROR, MAX_LEVEL as MAX_LEVEL
from .parse_output import OUTPUT as OUTPUT, OUTPUT_FILE as OUTPUT_FILE
from .scene_file import load_scene as load_scene, parse_scene_content as parse_scene_content
from .schedule import (
    in_order as in_order,
    is_film_wide_goal as is_film_wide_goal,
    min_tolerance as min_tolerance,
    through as through,
    tolerance_at as tolerance_at,
    value_at as value_at,
    with_tolerance as with_tolerance,
    with_tolerances as with_tolerances,
)
from .schema import (
    BOOLEAN as BOOLEAN,
    INVALID as INVALID,
    MAPPING as MAPPING,
    TEXT as TEXT,
    TILDE_HINT as TILDE_HINT,
    Kind as Kind,
    Node as Node,
    Table as Table,
    choice as choice,
    did_you_mean as did_you_mean,
    fields as fields,
    has_unexpanded_tilde as has_unexpanded_tilde,
    integer as integer,
    join as join,
    known as known,
    listed as listed,
    number as number,
    section as section,
    sequence as sequence,
    show as show,
)
from .spec import (
    FRAME_FIELD as FRAME_FIELD,
    MAX_WORLD_LENGTH as MAX_WORLD_LENGTH,
    MIN_TOLERANCE as MIN_TOLERANCE,
    MIN_WORLD_LENGTH as MIN_WORLD_LENGTH,
    PROCEDURAL_NAMES as PROCEDURAL_NAMES,
    SPEC_TYPES as SPEC_TYPES,
    AccuracyGoal as AccuracyGoal,
    ByFrame as ByFrame,
    CameraSpec as CameraSpec,
    Color as Color,
    ColormapSpec as ColormapSpec,
    ControlPoint as ControlPoint,
    ErrorSpec as ErrorSpec,
    FileSource as FileSource,
    KeyframePath as KeyframePath,
    OutputSpec as OutputSpec,
    ProceduralSource as ProceduralSource,
    PyramidSpec as PyramidSpec,
    RawSource as RawSource,
    RockerPath as RockerPath,
    Scene as Scene,
    ShadingSpec as ShadingSpec,
    SplatBudget as SplatBudget,
    SplatSpec as SplatSpec,
    TimeBudget as TimeBudget,
    TransferSpec as TransferSpec,
    TurntablePath as TurntablePath,
    Vector as Vector,
    VolumeSpec as VolumeSpec,
)
from .yaml_tree import (
    Mark as Mark,
    NotYamlError as NotYamlError,
    Tree as Tree,
    excerpt as excerpt,
    format_location as format_location,
    parse_yaml as parse_yaml,
    parse_yaml_file as parse_yaml_file,
)
