from .assemble.assembly import assemble_film as assemble_film
from .assemble.parts import find_parts as find_parts
from .events import (
    JobEvents as JobEvents,
    NotebookBar as NotebookBar,
    OnProgress as OnProgress,
    ProgressEvents as ProgressEvents,
)
from .executor import (
    DrawnFrame as DrawnFrame,
    Executor as Executor,
    LocalExecutor as LocalExecutor,
    draw_frames as draw_frames,
    open_local_executor as open_local_executor,
)
from .film_job import FilmJob as FilmJob
from .film_making import (
    JobResult as JobResult,
    forecast_film as forecast_film,
    make_film as make_film,
    one_pass as one_pass,
    open_job_stage as open_job_stage,
)
from .forecast import (
    Forecast as Forecast,
    LightCost as LightCost,
)
from .inputs import (
    expand_pattern as expand_pattern,
    header_data_files as header_data_files,
    scene_files as scene_files,
    volume_files as volume_files,
)
from .plan import FilmPlan as FilmPlan, make_plan as make_plan
from .refinement import Refinement as Refinement
from .trial_frames import forecast_frames as forecast_frames

# isort: split
# For tests alone: steps and constants that no other room uses.
from .checkpoint import (
    FrameCheckpoint as FrameCheckpoint,
    FrameStore as FrameStore,
    remove_checkpoint_frames as remove_checkpoint_frames,
)
from .output_writer import OutputWriter as OutputWriter, open_output as open_output
from .plan import search_tolerances as search_tolerances
from .trial_encoding import try_finer_encoding as try_finer_encoding
from .trial_frames import choose_trials as choose_trials
