"""Pairs of frames to compare."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from renderer.film import Pixels


@dataclass(frozen=True)
class Pair:
    """A golden frame and the actual one: uint8 [h, w, 3 or 4], straight alpha; None for a side without this frame.

    name: of the file, or `frame 12` of a film. is_golden_missing: the golden is absent although it is recorded.
    """

    name: str
    golden: Pixels | None
    actual: Pixels | None
    is_golden_missing: bool = False


@dataclass(frozen=True)
class Pairs:
    """All pairs of a comparison, read one at a time, in the order of `names`.

    Iterating over `pairs` raises InputError if a frame cannot be read. notes, facts: as in Comparison.
    """

    names: Sequence[str]
    pairs: Iterator[Pair]
    notes: Sequence[str] = ()
    facts: Mapping[str, tuple[str, str]] = field(default_factory=dict)
