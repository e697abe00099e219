from .batch import run_batch as run_batch
from .gallery import Gallery as Gallery
from .one_film import (
    FilmRequest as FilmRequest,
    make_film as make_film,
    print_film_record as print_film_record,
    require_harmless as require_harmless,
)

# isort: split
# For tests alone: steps and constants that no other room uses.
from .manifest import (
    locked_manifest as locked_manifest,
    update_manifest as update_manifest,
)
from .one_film import marked_scene as marked_scene, write_scene as write_scene
