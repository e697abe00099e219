from .bricks.brick_rasterizer import BrickRasterizer as BrickRasterizer
from .lines import draw_lines as draw_lines
from .opening import open_rasterizer as open_rasterizer
from .overlay import Lines as Lines, make_edges as make_edges, make_outline as make_outline
from .rasterizer import BrickMemory as BrickMemory, Rasterizer as Rasterizer
from .splats.opengl_probe import describe_opengl as describe_opengl
from .splats.recovery import RecoveringRasterizer as RecoveringRasterizer
from .splats.splat_rasterizer import SplatRasterizer as SplatRasterizer

# isort: split
# For tests alone: steps and constants that no other room uses.
from .bricks.atlas import Atlas as Atlas
from .bricks.bands import plan_bands as plan_bands
from .bricks.brick_rasterizer import share_memory as share_memory, share_out as share_out
from .bricks.grid import RayGrid as RayGrid, make_grid as make_grid
from .overlay import tick_step as tick_step
