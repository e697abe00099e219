"""Find the images of BigDataViewer's HDF5 files: setups, such as channels and views, each with times and levels.

Voxels are unsigned integers of 16 bits, stored as signed ones. Names, lengths and channels are in an .xml file beside
the HDF5 file.
"""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from renderer.errors import InputError
from renderer.readers.affines import NO_SPACING
from renderer.readers.hdf5_image import Candidate
from renderer.readers.hdf5_levels import Pyramid, axes_in_space, place_by
from renderer.readers.hdf5_objects import Group, dataset_at, open_inside
from renderer.readers.statements import FormatTable, Statement
from renderer.readers.text_header import MAX_HEADER_BYTES
from renderer.scene import short_text
from renderer.stores import ImagePlan, LevelPlan
from renderer.system import number_in
from renderer.volume import Channel, Float64

STATEMENTS = FormatTable(
    "BigDataViewer",
    (
        Statement("cells", "values", "unsigned numbers of 16 bits, stored as signed ones"),
        Statement("resolutions", "place", "the levels of one image, and their steps"),
        Statement("size", "values", "the size without padding, in .xml"),
        Statement("voxelSize", "place", "the lengths of voxels and their unit, in .xml"),
        Statement("channel", "meaning", "setups that are channels of one image, in .xml"),
        Statement("name", "meaning", "the name of a setup, in .xml"),
        Statement("ViewRegistrations", "place", "the place of the image of each setup", is_applied=False),
    ),
)

# The name of the HDF5 group of a setup, with the number of the setup.
_SETUP = re.compile("s([0-9]{2,6})")

# The largest number of times of an image. Further times are not found.
_MAX_TIMES = 10_000
# The largest number of levels of resolution of an image. A group with more levels does not count as a setup.
_MAX_LEVELS = 64
# The largest size of a voxel of a coarser level, in voxels of the finest level. A larger size is an error.
_MAX_FACTOR = 2**20
# The note on lengths that are guessed because there is no .xml file.
_NO_XML = f"{NO_SPACING}: the .xml of BigDataViewer, which has it, is not beside it"


@dataclass(frozen=True)
class _Setup:
    """A setup, such as a channel or a view, as the .xml file describes it.

    sizes: the numbers of voxels along z, y and x. lengths: the lengths of a voxel along z, y and x, in `unit`. others:
    the names and values of all attributes except for the channel, such as the angle. Setups that agree in `others` are
    channels of one image.
    """

    number: int
    name: str = ""
    sizes: tuple[int, ...] = ()
    lengths: tuple[float, ...] = ()
    unit: str = ""
    others: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True)
class _Description:
    """The content of the .xml file beside an HDF5 file.

    setups: the setups, by number. is_moved: whether the file turns or shifts images. is_there: whether the file exists.
    """

    setups: dict[int, _Setup] = field(default_factory=dict)
    is_moved: bool = False
    is_there: bool = False


def find_images(file: Group) -> list[Candidate]:
    """Return the images of a file with their levels; each image has one setup, or several that are its channels."""
    numbers = sorted(int(name[1:]) for name in file if _SETUP.fullmatch(name))
    levels = {number: factors for number in numbers if len(factors := _level_factors(file, number))}
    if not levels or open_inside(file, "t00000") is None:
        return []
    description, found = _description(Path(file.filename)), []
    for setups in _channels_of_images([*levels], description):
        data, setup = dataset_at(file, _path(setups, 0, 0, 0)), description.setups.get(setups[0])
        shape = setup.sizes if setup and setup.sizes else data.shape if data is not None else ()
        describe = partial(_describe, file, setups, levels[setups[0]], description)
        found.append(Candidate(f"s{setups[0]:02}", shape, describe))
    return found


def _level_factors(file: Group, setup: int) -> Float64:
    """Return the sizes of the voxels of each level, [level, xyz], in voxels of the finest level.

    The array is empty if the group is not a setup.
    """
    table = dataset_at(file, f"s{setup:02}/resolutions")
    if table is None or table.ndim != 2 or table.shape[1] != 3 or not 0 < len(table) <= _MAX_LEVELS:
        return np.zeros((0, 3))
    factors = np.asarray(table[...], np.float64)
    if not ((factors >= 1) & (factors <= _MAX_FACTOR)).all():
        raise InputError("this BigDataViewer file has no sizes for its levels of resolution", got=f"s{setup:02}")
    return factors


def _channels_of_images(numbers: Sequence[int], description: _Description) -> list[list[int]]:
    """Return the numbers of the setups of each image; setups that differ only in their channel form one image."""
    images: dict[object, list[int]] = {}
    for number in numbers:
        setup = description.setups.get(number)
        key = number if setup is None or not setup.sizes else (setup.sizes, setup.lengths, setup.others)
        images.setdefault(key, []).append(number)
    return list(images.values())


def _describe(file: Group, setups: Sequence[int], factors: Float64, description: _Description) -> Pyramid:
    """Return an image, with each setup as a channel. factors: as `_level_factors` returns them."""
    num_times = next((k for k in range(_MAX_TIMES) if open_inside(file, f"t{k:05}") is None), _MAX_TIMES)
    setup = description.setups.get(setups[0], _Setup(setups[0]))
    # A voxel of a coarser level is the mean of several fine voxels, and lies at their centre.
    plans = tuple(
        LevelPlan(
            f"s{setups[0]:02}/{level}",
            place_by([((factor - 1) / 2 * size, factor * size)
                      for size, factor in zip(setup.lengths or (1.0, 1.0, 1.0), own[::-1], strict=True)]),
        )
        for level, own in enumerate(factors.tolist())
    )  # fmt: skip
    no_lengths = NO_SPACING if description.is_there else _NO_XML
    moved = STATEMENTS.note({"ViewRegistrations"} if description.is_moved else ())
    plan = ImagePlan(
        "hdf5",
        axes_in_space(setup.unit),
        plans,
        tuple(Channel(description.setups.get(number, _Setup(number)).name, is_light=True) for number in setups),
        notes=tuple(filter(None, (moved, None if setup.lengths else no_lengths))),
    )
    unknown = (0, 0, 0)
    sizes = [setup.sizes or unknown, *[unknown] * (len(factors) - 1)]
    return Pyramid(plan, sizes, num_times, len(setups), partial(_path, setups), is_unsigned=True)


def _path(setups: Sequence[int], level: int, time: int, channel: int) -> str:
    return f"t{time:05}/s{setups[channel]:02}/{level}/cells"


def _description(path: Path) -> _Description:
    """Return the content of the .xml file beside an HDF5 file; an empty one if there is no such file of BigDataViewer.

    Raises InputError for a file that is damaged, too long, or has entities, which may expand to any length.
    """
    beside = path.with_suffix(".xml")
    is_inside = Path(os.path.realpath(beside)).is_relative_to(os.path.realpath(path.parent))
    if not is_inside or not beside.is_file():
        return _Description()
    with beside.open("rb") as file:
        text = file.read(MAX_HEADER_BYTES + 1)
    try:
        if len(text) > MAX_HEADER_BYTES or b"<!" in text.replace(b"<!--", b""):
            raise ValueError("too long, or with entities")
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise InputError(
            "the description beside this BigDataViewer file cannot be read",
            where=str(beside),
            got=short_text(str(error)),
            hint="it is damaged: without it the file is read with voxels of 1 x 1 x 1",
        ) from error
    if root.tag != "SpimData":
        return _Description()
    setups = (_setup(each) for each in root.iter("ViewSetup"))
    moves = [each.text or "" for each in root.iter("affine")]
    return _Description({each.number: each for each in setups if each}, any(map(_moves, moves)), True)


def _setup(element: ElementTree.Element) -> _Setup | None:
    """Return a setup of an .xml file; None for an element without a number."""
    number = number_in((element.findtext("id") or "").strip())
    if not 0 <= number < 2**31:
        return None
    sizes, lengths = (_numbers(element.findtext(path))[::-1] for path in ("size", "voxelSize/size"))
    attributes = element.find("attributes")
    others = () if attributes is None else tuple(
        (each.tag, each.text or "") for each in attributes if each.tag != "channel"
    )  # fmt: skip
    return _Setup(
        int(number),
        short_text(element.findtext("name") or ""),
        tuple(int(n) for n in sizes if 1 <= n < 2**31) if len(sizes) == 3 else (),
        tuple(lengths) if len(lengths) == 3 and all(0 < n < np.inf for n in lengths) else (),
        element.findtext("voxelSize/unit") or "",
        others,
    )


def _moves(text: str) -> bool:
    """Return whether a text with the 12 numbers of an affine does more than scale the axes."""
    numbers = np.array(_numbers(text))
    if len(numbers) != 12:
        return False
    matrix = numbers.reshape(3, 4)
    return bool((matrix != np.eye(3, 4) * np.diag(matrix)[:, np.newaxis]).any())


def _numbers(text: str | None) -> list[float]:
    return [number_in(word) for word in (text or "").split()[:12]]
