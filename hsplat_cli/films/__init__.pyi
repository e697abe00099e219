from .accuracy import (
    find_truths as find_truths,
    nothing_visible_error as nothing_visible_error,
    search_tolerance as search_tolerance,
)
from .assemble.assembly import assemble_film as assemble_film
from .assemble.parts import Part as Part, find_parts as find_parts
from .film import FilmResult as FilmResult
from .fingerprint import describe_differences as describe_differences
from .progressive import Refinement as Refinement
from .render import render_film as render_film
