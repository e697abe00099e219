"""Recognise URLs of stores, which a scene may name in place of a volume's file."""

from __future__ import annotations

import re
from pathlib import Path

# The schemes of the URLs under which a store is read.
SCHEMES = ("http", "https", "s3", "gs")
_URL = re.compile(rf"(?:{'|'.join(SCHEMES)})://[^/\s]")


def is_url(text: object) -> bool:
    """Return whether a value is the text of a URL under which a store may be read."""
    return isinstance(text, str) and _URL.match(text) is not None


def path_or_url(text: str) -> Path | str:
    """Return the place of a volume that an argument names: a path, or the text of a URL as it is."""
    return text if is_url(text) else Path(text)
