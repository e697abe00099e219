from .costs import CostLog as CostLog, Workload as Workload, workload_of as workload_of
from .frame import (
    Clock as Clock,
    Frame as Frame,
    Rasterizer as Rasterizer,
    Stage as Stage,
    Stopwatch as Stopwatch,
    bring as bring,
    draw as draw,
    finest_level_at as finest_level_at,
    make_draw_list as make_draw_list,
    make_lod as make_lod,
    make_primitive as make_primitive,
    view_of as view_of,
)
from .pacing import (
    BudgetController as BudgetController,
    Details as Details,
    Guide as Guide,
    ScheduleController as ScheduleController,
    calibrate_costs as calibrate_costs,
    find_finest_in_time as find_finest_in_time,
)
from .pipeline import prepare as prepare, render_frames as render_frames
from .transport import pack as pack, packed as packed, unpack as unpack
