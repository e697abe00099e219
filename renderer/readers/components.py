"""Choose the time step and the component that are read, and find out whether components are light or colours."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from renderer.errors import InputError
from renderer.readers.image import Image
from renderer.readers.steps_in_time import TimeSteps
from renderer.scene import join_some, short_text
from renderer.volume import Channel

# The largest number of components of an image that are each drawn as light of their own, like channels of a microscope.
# More components are, for example, a spectrum: one of them is drawn.
MAX_LIGHTS = 8
# The largest number of components of an image that are described, by a `Channel` each.
MAX_LISTED = 1000

# The RGB colour of a component, by the name of the component.
_PRIMARIES = {"R": (1.0, 0.0, 0.0), "G": (0.0, 1.0, 0.0), "B": (0.0, 0.0, 1.0)}


def select_index(key: str, wanted: int | None, count: int) -> int:
    """Return the index of the time step or component to read, out of `count`: the first one if none is wanted.

    key: the scene's key for the index. wanted: the index in the scene, None without one. Raises InputError if there is
        no such index.
    """
    if wanted is not None and not 0 <= wanted < count:
        raise InputError(
            f"there is no such {'time step' if key == 'time' else key}",
            got=f"{key}: {wanted}",
            expected=f"0 to {count - 1}" if count > 1 else f"0 or no `{key}` at all: the volume has one",
        )
    return wanted or 0


class Chosen(NamedTuple):
    """A choice of the part of an array that is read: one time step and one component.

    part: the index of the part in the array. step, component: the numbers of the time step and the component. is_step:
        whether the scene asks for a time step.
    notes: a remark if there are several time steps and the scene asks for none, and a remark on components.
    channels: the descriptions of the components. Components with names are described as not being light of their own;
        components named R, G or B have the colour of the name.
    steps: the steps in time of the array.
    """

    part: tuple[int | slice, ...]
    step: int
    component: int
    is_step: bool
    notes: tuple[str, ...]
    channels: tuple[Channel, ...]
    steps: TimeSteps


def choose(
    axes: str,
    shape: tuple[int, ...],
    time: int | None,
    component: int | None,
    names: Sequence[str] = (),
    by_axis: Mapping[str, str] = MappingProxyType({}),
) -> Chosen:
    """Return the part of an array that is read. Raises InputError if the array has no such time step or component.

    axes: a letter for each axis: `t` for time, `c` for components, `-` for an axis whose first item is chosen, and any
        other letter for an axis in space. time, component: the scene's choice, None without one. names: the names of
        the components, if all have one. by_axis: for the letter of an axis, the name of the property in which its items
        differ.
    """
    lengths = {"t": 1, "c": 1} | dict(zip(axes, shape, strict=True))
    step, own = select_index("time", time, lengths["t"]), select_index("component", component, lengths["c"])
    about = {axis: f" (by {short_text(name)})" for axis, name in by_axis.items()}
    count, channels = lengths["c"], (Channel(),) * (min(lengths["c"], MAX_LISTED) if lengths["c"] > 1 else 0)
    if len(names) == count > 1:
        about["c"] = f" ({join_some(names)})"
        channels = tuple(Channel(name, _PRIMARIES.get(name), is_light=False) for name in names)
    may_be_colors = count in (3, 4) and "c" not in by_axis and _may_be_colors(names)
    hints = {"c": "; `component: color` draws the colours" * may_be_colors}
    notes = tuple(
        f"{lengths[letter]} {key}s{about.get(letter, '')}; the first is drawn; `{key}: k` chooses another"
        f"{hints.get(letter, '')}"
        for letter, key, wanted in (("t", "time", time), ("c", "component", component))
        if wanted is None and lengths[letter] > 1
    )
    part = tuple({"t": step, "c": own, "-": 0}.get(letter, slice(None)) for letter in axes)
    return Chosen(part, step, own, time is not None, notes, channels, TimeSteps(lengths["t"]))


def are_light(image: Image) -> bool:
    """Return whether each component of an image is light of its own, like a channel of a microscope.

    The file decides. If it does not say so, integers are light, but floats are the parts of a vector, and three or four
    components of a byte each are a colour. Components that are labels are no light.
    """
    if image.labels or not 2 <= len(image.channels) <= MAX_LIGHTS:
        return False
    may_be_light = image.values.dtype.kind != "f" and (image.values.itemsize > 1 or len(image.channels) not in (3, 4))
    return all(may_be_light if each.is_light is None else each.is_light for each in image.channels)


def are_colors(dtype: npt.DTypeLike, channels: Sequence[Channel]) -> bool:
    """Return whether three or four components form a colour, and none is light of its own.

    They do if their names begin with R, G and B, or if they are bytes and their names allow a colour.
    """
    names = [each.name for each in channels]
    if len(names) not in (3, 4) or any(each.is_light for each in channels):
        return False
    return names[:3] == ["R", "G", "B"] or (np.dtype(dtype) == np.uint8 and _may_be_colors(names))


def _may_be_colors(names: Sequence[str]) -> bool:
    """Return whether the names of components allow a colour: `R`, `G`, `B`, no names, or numbers in brackets.

    Names of another colour space, or of several arrays, rule it out.
    """
    are_numbered = all(not name or name.endswith(f"[{number}]") for number, name in enumerate(names))
    return are_numbered or list(names[:3]) == ["R", "G", "B"]
