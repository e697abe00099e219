"""Pairs of frames to compare."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from renderer.film import Pixels


@dataclass(frozen=True)
class Pair:
    """A golden frame and the actual one: uint8 [h, w, 3 or 4], straight alpha; None for a side without this frame.

    name: of the file, or `frame 12` of a film. number: of the frame, if its name contains one. is_golden_missing: the
    golden is absent although it is recorded.
    """

    name: str
    golden: Pixels | None
    actual: Pixels | None
    number: int | None = None
    is_golden_missing: bool = False


@dataclass(frozen=True)
class Pairs:
    """All pairs of a comparison, of which iteration reads one at a time.

    read: returns an iterator over the pairs, in the order of `names`; it raises InputError if a frame cannot be read.
    notes, facts: as in Comparison.
    """

    names: Sequence[str]
    read: Callable[[], Iterator[Pair]]
    notes: Sequence[str] = ()
    facts: Mapping[str, tuple[str, str]] = field(default_factory=dict)
