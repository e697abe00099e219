from .assemble.film import assemble_film as assemble_film
from .assemble.parts import Part as Part, find_parts as find_parts
from .cause import differences as differences
from .film import render_once as render_once
from .place import taken as taken
from .progressive import render_progressively as render_progressively
from .search import beyond_full_resolution as beyond_full_resolution, search_tolerance as search_tolerance
from .truths import find_truths as find_truths, nothing_to_measure as nothing_to_measure
