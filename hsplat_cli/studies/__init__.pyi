from .measure.options import parse_sweep as parse_sweep, parse_want as parse_want
from .measure.study import Request as Request, run_study as run_study
from .measure.want import find_wanted as find_wanted
from .paper.figure import Figure as Figure
from .paper.page import paper_page as paper_page
from .paper.studio import Studio as Studio
