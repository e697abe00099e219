"""Put random mistakes into plain data, for tests of files that anybody may have edited."""

from __future__ import annotations

import copy
import random
from collections.abc import Iterator, Sequence
from typing import Any


def places(tree: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, Any, tuple[Any, ...]]]:
    """Yield, for each value in a tree: its container, its key, and all keys from the root to it."""
    for key, value in tree.items() if isinstance(tree, dict) else enumerate(tree):
        yield tree, key, (*path, key)
        if isinstance(value, (dict, list)):
            yield from places(value, (*path, key))


def spoil(tree: dict[str, Any], choose: random.Random, junk: Sequence[Any], keys: Sequence[Any]) -> None:
    """Add a random value to a tree, or remove or replace one.

    junk: the values that are added, or replace others. keys: the keys of values that are added.
    """
    every = list(places(tree))
    container, key, _ = choose.choice(every) if every else (tree, keys[0], ())
    action, thing = choose.random(), copy.deepcopy(choose.choice(junk))
    if action < 0.2 and isinstance(container, dict):
        container[choose.choice(keys)] = thing
    elif action < 0.4 and every:
        del container[key]
    else:
        container[key] = thing
