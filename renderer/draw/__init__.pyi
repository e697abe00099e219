from .bricks.brick_rasterizer import BrickRasterizer as BrickRasterizer
from .lines import draw_lines as draw_lines
from .opening import open_rasterizer as open_rasterizer
from .overlay import Lines as Lines, make_edges as make_edges, make_outline as make_outline
from .rasterizer import BrickMemory as BrickMemory, Rasterizer as Rasterizer
from .splats.recovery import RecoveringRasterizer as RecoveringRasterizer
from .splats.splat_rasterizer import SplatRasterizer as SplatRasterizer
