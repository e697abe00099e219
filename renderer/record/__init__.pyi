from .accuracy_records import accuracy_text as accuracy_text
from .citation import bibtex as bibtex, methods_text as methods_text
from .film_record import (
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
from .fingerprint import describe_differences as describe_differences
from .own_files import require_own_files as require_own_files
from .verification import (
    FilmFiles as FilmFiles,
    VerifiedFilm as VerifiedFilm,
    verify_files as verify_files,
    verify_film as verify_film,
)
from .verified_accuracy import MeasuredFilm as MeasuredFilm, RayOptions as RayOptions
from .visibility_records import (
    film_visibility as film_visibility,
    range_record as range_record,
    visibility_text as visibility_text,
)
