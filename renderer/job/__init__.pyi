from .assemble.assembly import assemble_film as assemble_film
from .assemble.parts import Part as Part, find_parts as find_parts
from .checkpoint import FrameCheckpoint as FrameCheckpoint
from .citation import bibtex as bibtex, methods_text as methods_text
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
from .film_accuracy import accuracy_text as accuracy_text
from .film_job import FilmJob as FilmJob, OriginalFilm as OriginalFilm
from .film_making import (
    FinishedFilm as FinishedFilm,
    forecast_film as forecast_film,
    make_film as make_film,
    one_pass as one_pass,
)
from .film_visibility import (
    film_visibility as film_visibility,
    range_record as range_record,
    visibility_text as visibility_text,
)
from .fingerprint import describe_differences as describe_differences
from .forecast import Forecast as Forecast, forecast_frames as forecast_frames
from .inputs import (
    expand_pattern as expand_pattern,
    header_data_files as header_data_files,
    scene_files as scene_files,
    volume_files as volume_files,
)
from .own_files import require_own_files as require_own_files
from .pictures import require_annotation as require_annotation
from .plan import FilmPlan as FilmPlan, make_plan as make_plan
from .record import (
    DIGEST_FIELD as DIGEST_FIELD,
    FilmAccuracy as FilmAccuracy,
    FilmFingerprint as FilmFingerprint,
    FilmRecord as FilmRecord,
    FilmVisibility as FilmVisibility,
    FrameRecord as FrameRecord,
    VisibleRange as VisibleRange,
    late_frame_problems as late_frame_problems,
    parse_film_record as parse_film_record,
    record_to_json as record_to_json,
)
from .refinement import Refinement as Refinement
from .verification import (
    FilmFiles as FilmFiles,
    VerifiedFilm as VerifiedFilm,
    verify_files as verify_files,
    verify_film as verify_film,
)
from .verified_accuracy import MeasuredFilm as MeasuredFilm, RayOptions as RayOptions

# isort: split
# For tests alone: steps and constants that no other room uses.
from .checkpoint import FrameStore as FrameStore, remove_checkpoint_frames as remove_checkpoint_frames
from .film_output import FilmOutput as FilmOutput, locked_film_output as locked_film_output
from .forecast import choose_trials as choose_trials
from .plan import search_tolerances as search_tolerances
from .record import read_frame_record as read_frame_record
from .sidecar import write_sidecar as write_sidecar
