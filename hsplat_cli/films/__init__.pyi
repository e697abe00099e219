from .assemble.film import assemble_film as assemble_film
from .assemble.parts import Part as Part, find_parts as find_parts
from .film import render_once as render_once
from .fingerprint import differences as differences
from .progressive import render_progressively as render_progressively
from .tolerance_search import search_tolerance as search_tolerance
from .truths import find_truths as find_truths, nothing_visible_error as nothing_visible_error
