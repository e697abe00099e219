from .measure.options import parse_sweep as parse_sweep, parse_want as parse_want
from .measure.study import Request as Request, run_study as run_study
from .measure.tolerance import print_tolerance as print_tolerance
from .paper.figure_renderer import Studio as Studio
from .paper.paper_figure import Figure as Figure
from .paper.paper_html import paper_page as paper_page
