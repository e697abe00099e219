from . import field_types as field_types
from .accuracy_records import (
    accuracy_text as accuracy_text,
    film_accuracy as film_accuracy,
    finer_file as finer_file,
    flicker_text as flicker_text,
    frame_accuracy as frame_accuracy,
    with_encoding_errors as with_encoding_errors,
)
from .citation import bibtex as bibtex, methods_text as methods_text
from .file_limits import limit_notes as limit_notes
from .film_record import (
    BrickMemoryRecord as BrickMemoryRecord,
    DifferenceRecord as DifferenceRecord,
    FilmAccuracy as FilmAccuracy,
    FilmFingerprint as FilmFingerprint,
    FilmRecord as FilmRecord,
    FilmVisibility as FilmVisibility,
    FinerFile as FinerFile,
    FrameRecord as FrameRecord,
    MeasuredRecord as MeasuredRecord,
    OutputRecord as OutputRecord,
    PartRecord as PartRecord,
    PassRecord as PassRecord,
    ScheduleRecord as ScheduleRecord,
    VisibleRange as VisibleRange,
    late_frame_problems as late_frame_problems,
    min_max as min_max,
    read_frame_record as read_frame_record,
)
from .fingerprint import film_fingerprint as film_fingerprint, fingerprint_of as fingerprint_of
from .finished_film import FinishedFilm as FinishedFilm, find_finished_film as find_finished_film
from .goals import (
    BEST_EFFORT_HINT as BEST_EFFORT_HINT,
    missed_goal as missed_goal,
    not_refined as not_refined,
    range_text as range_text,
    summary_parts as summary_parts,
)
from .own_files import naming_mark as naming_mark, require_own_files as require_own_files
from .picture_files import FrameFile as FrameFile, picture_problems as picture_problems
from .record_file import RecordFile as RecordFile, record_to_json as record_to_json
from .record_making import (
    device_notes as device_notes,
    make_film_record as make_film_record,
    make_frame_record as make_frame_record,
    shortfall_notes as shortfall_notes,
    version_notes as version_notes,
    visibility_notes as visibility_notes,
)
from .rounding import (
    round_decibels as round_decibels,
    round_seconds as round_seconds,
    round_share as round_share,
)
from .sidecar import SIDECAR as SIDECAR, parse_film_record as parse_film_record
from .up_to_date import (
    FileStates as FileStates,
    Fingerprint as Fingerprint,
    MadeFile as MadeFile,
    describe_differences as describe_differences,
    describe_mismatch as describe_mismatch,
    differences as differences,
    file_states as file_states,
    program_versions as program_versions,
)
from .verification import (
    FilesCheck as FilesCheck,
    PicturesCheck as PicturesCheck,
    verify_files as verify_files,
    verify_pictures as verify_pictures,
)
from .verified_accuracy import RayOptions as RayOptions
from .visibility_records import (
    film_visibility as film_visibility,
    range_record as range_record,
    visibility_text as visibility_text,
)

# isort: split
# For tests alone: steps and constants that no other room uses.
from .film_record import (
    FrameAccuracy as FrameAccuracy,
    SharedProbes as SharedProbes,
    WorstFrame as WorstFrame,
)
