from .crew import open_crew as open_crew
from .drawn import Drawer as Drawer, Drawn as Drawn, LocalDrawer as LocalDrawer
from .executor_arguments import (
    CrewSpec as CrewSpec,
    crew_options as crew_options,
    require_crew as require_crew,
    require_crew_for as require_crew_for,
    workers_option as workers_option,
)
from .rasterizers import open_lasting_rasterizer as open_lasting_rasterizer, open_rasterizer as open_rasterizer
from .workers.lifeline import Lifeline as Lifeline
