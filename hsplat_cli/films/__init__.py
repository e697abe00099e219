"""A job to a film: resumed, refined, assembled.

In: `Job` and executor options. Out: the film, its frames and its sidecar. Unfinished films resume where they stopped; a
film that is up to date is not drawn again.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
