from .batch import run_batch as run_batch
from .film_process import make_requested_films as make_requested_films
from .film_request import FilmRequest as FilmRequest, require_harmless as require_harmless
from .gallery import Gallery as Gallery
from .manifest import require_own_folder as require_own_folder
from .one_film import make_film as make_film

# isort: split
# For tests alone: steps and constants that no other room uses.
from .manifest import (
    FILM_ENTRY as FILM_ENTRY,
    MANIFEST as MANIFEST,
    MANIFEST_FILE as MANIFEST_FILE,
    FilmEntry as FilmEntry,
    locked_manifest as locked_manifest,
    update_manifest as update_manifest,
)
from .one_film import marked_scene as marked_scene, write_scene as write_scene
