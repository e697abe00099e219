from .costs import CostLog as CostLog, Workload as Workload, workload_of as workload_of
from .frame import (
    Clock as Clock,
    Frame as Frame,
    Rasterizer as Rasterizer,
    Stage as Stage,
    Stopwatch as Stopwatch,
    draw_frame as draw_frame,
    finest_level_at as finest_level_at,
    make_draw_list as make_draw_list,
    make_lod as make_lod,
    make_primitive as make_primitive,
    upload as upload,
    view_of as view_of,
)
from .pacing import (
    BudgetController as BudgetController,
    LODCostEstimator as LODCostEstimator,
    ScheduleController as ScheduleController,
    ToleranceController as ToleranceController,
    calibrate_costs as calibrate_costs,
    find_finest_in_time as find_finest_in_time,
)
from .pipeline import prepare_stage as prepare_stage, render_frames as render_frames
from .records import film_record as film_record, frame_record as frame_record, visibility_notes as visibility_notes
from .transport import (
    deserialize_stage as deserialize_stage,
    serialize_stage as serialize_stage,
    serialized_stage as serialized_stage,
)
