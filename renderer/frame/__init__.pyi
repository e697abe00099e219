from .costs import CostLog as CostLog, Load as Load, load_of as load_of
from .frame import (
    Clock as Clock,
    Frame as Frame,
    Rasterizer as Rasterizer,
    Stage as Stage,
    Stopwatch as Stopwatch,
    bring as bring,
    draw as draw,
    family_of as family_of,
    finest_level_at as finest_level_at,
    make_detail as make_detail,
    make_pose as make_pose,
    view_of as view_of,
)
from .pacing import (
    Details as Details,
    Guide as Guide,
    Pacer as Pacer,
    Scheduled as Scheduled,
    finest_within as finest_within,
    try_drawings as try_drawings,
)
from .pipeline import prepare as prepare, render_frames as render_frames
from .transport import pack as pack, packed as packed, unpack as unpack
