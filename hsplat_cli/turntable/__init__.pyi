from .batch import run_batch as run_batch
from .gallery import Gallery as Gallery
from .one_film import (
    FilmRequest as FilmRequest,
    make_film as make_film,
    print_film_record as print_film_record,
    require_harmless as require_harmless,
)
