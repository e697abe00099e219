"""Plain data with random mistakes, for tests of files that anybody may have edited."""

from __future__ import annotations

import copy
import random
from collections.abc import Iterator, Sequence
from typing import Any


def places(tree: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, Any, tuple[Any, ...]]]:
    """Yield every (container, key, keys on the way) in a tree."""
    for key, value in tree.items() if isinstance(tree, dict) else enumerate(tree):
        yield tree, key, (*path, key)
        if isinstance(value, (dict, list)):
            yield from places(value, (*path, key))


def spoil(tree: dict[str, Any], choose: random.Random, junk: Sequence[Any], keys: Sequence[Any]) -> None:
    """Add, remove or replace a random thing by junk; `keys`: for what is added."""
    every = list(places(tree))
    container, key, _ = choose.choice(every) if every else (tree, keys[0], ())
    action, thing = choose.random(), copy.deepcopy(choose.choice(junk))
    if action < 0.2 and isinstance(container, dict):
        container[choose.choice(keys)] = thing
    elif action < 0.4 and every:
        del container[key]
    else:
        container[key] = thing
