from .budget import (
    BudgetController as BudgetController,
    LODCostEstimator as LODCostEstimator,
    ScheduleController as ScheduleController,
    ToleranceController as ToleranceController,
    calibrate_costs as calibrate_costs,
    find_finest_in_time as find_finest_in_time,
)
from .camera_framing import framing_note as framing_note
from .film_annotation import (
    FilmAnnotation as FilmAnnotation,
    annotation_notes as annotation_notes,
    require_annotation as require_annotation,
)
from .frame import Frame as Frame, draw_frame as draw_frame, make_draw_list as make_draw_list
from .pipeline import prepare_stage as prepare_stage, render_frames as render_frames
from .preparation import (
    FilmVolumes as FilmVolumes,
    StageMaker as StageMaker,
    read_film_volumes as read_film_volumes,
)
from .primitives import make_primitive as make_primitive
from .stage import (
    Clock as Clock,
    FilmStage as FilmStage,
    Stage as Stage,
    Stopwatch as Stopwatch,
    finest_level_at as finest_level_at,
    view_of as view_of,
)
from .transport import (
    deserialize_stage as deserialize_stage,
    serialize_stage as serialize_stage,
)

# isort: split
# For tests alone: steps and constants that no other room uses.
from .frame import DrawList as DrawList
from .primitives import (
    SplatLOD as SplatLOD,
    num_samples as num_samples,
)
