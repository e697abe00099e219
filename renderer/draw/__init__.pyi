from .cpu.raster import CPURasterizer as CPURasterizer
from .gl.raster import GLRasterizer as GLRasterizer, is_software as is_software
from .overlay import CellEdges as CellEdges, make_edges as make_edges
from .rasterizer import Rasterizer as Rasterizer
from .recovery import RecoveringRasterizer as RecoveringRasterizer, open_rasterizer as open_rasterizer
