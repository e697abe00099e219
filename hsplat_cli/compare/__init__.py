"""Pictures against golden ones.

In: two sets of pictures, films or a scene and its golden frames, and limits. Out: a verdict for each pair, as a table,
an HTML report and JUnit. `golden/` keeps golden frames and says what they were drawn from.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
