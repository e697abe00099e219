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
    nearest_file as nearest_file,
    read_content as read_content,
)
from .limits import (
    camera_problems as camera_problems,
    extent_of as extent_of,
    require_proportion as require_proportion,
    volume_problems as volume_problems,
)
from .parse import (
    scene_to_dict as scene_to_dict,
    schedule_to_dict as schedule_to_dict,
    splats_as_asked as splats_as_asked,
)
from .parse_camera import FRAME_NUMBER as FRAME_NUMBER, MAX_FRAMES as MAX_FRAMES
from .parse_error import ERROR as ERROR, MAX_LEVEL as MAX_LEVEL
from .parse_output import OUTPUT as OUTPUT, OUTPUT_FILE as OUTPUT_FILE
from .scene_file import load_scene as load_scene, scene_in as scene_in
from .schedule import (
    at_tolerance as at_tolerance,
    at_tolerances as at_tolerances,
    in_order as in_order,
    is_met_as_a_whole as is_met_as_a_whole,
    least_tolerance as least_tolerance,
    through as through,
    tolerance_at as tolerance_at,
    value_at as value_at,
)
from .schema import (
    BOOLEAN as BOOLEAN,
    INVALID as INVALID,
    MAPPING as MAPPING,
    NO_HOME as NO_HOME,
    TEXT as TEXT,
    Kind as Kind,
    Node as Node,
    Table as Table,
    choice as choice,
    did_you_mean as did_you_mean,
    fields as fields,
    in_no_home as in_no_home,
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
    LEAST_TOLERANCE as LEAST_TOLERANCE,
    LONGEST as LONGEST,
    PROCEDURAL_NAMES as PROCEDURAL_NAMES,
    SHORTEST as SHORTEST,
    SPECS as SPECS,
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
from .want import Want as Want
from .yaml_tree import (
    Mark as Mark,
    NotYamlError as NotYamlError,
    Tree as Tree,
    excerpt as excerpt,
    place_in as place_in,
    read_tree as read_tree,
    tree_of_file as tree_of_file,
)
