"""Keep levels of stores in the cache folder, decoded, so that a later film of the same store need not read them.

An entry has the voxels of one level, time step, component and crop; or some blocks of them, by which levels were
compared. It counts as one of a local store as long as all
files of the store have the same names, sizes and times. Of a store at a URL, the metadata are read again, and compared.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from renderer.cache import CacheFolder, cache_folder
from renderer.readers.image import Image
from renderer.readers.isolation import kept_image, share_voxels
from renderer.readers.level_parts import has_blocks, level_read, read_rest, with_blocks
from renderer.readers.recent_images import marks_of
from renderer.readers.store_blocks import Blocks

# The kind of these entries in the cache folder.
_KIND = "level"
# The kind of entries with some blocks of a level.
_PART_KIND = "part"
# The name of the array, in such an entry, that says which blocks it has.
_BLOCKS = "blocks"
# The number of bytes of the digest of a file's name, size and time.
_DIGEST_BYTES = 16
# The marks of stores by their places, in a block of `looking_once`; None outside of one. To find the marks of 19,000
# files takes 0.1 s.
_KNOWN_MARKS: ContextVar[dict[Path, str] | None] = ContextVar("known marks of stores", default=None)


def read_kept(read: Callable[..., Image], part: Image | None, place: Path | str, wanted: Mapping[str, Any]) -> Image:
    """Return a level from the cache folder, or else read it, and keep it there if the process has such a folder.

    Another process that reads it is waited for. What a process has read that was ended is not read again.

    read: reads the level in a child process, into an entry of the cache folder (`entry`), or some of its blocks
        (`blocks`). part: blocks of the level that this process has read, None if it has read none. place: the path or
        the URL of the store. wanted: the part of it, as in `Wanted`.
    """
    folder = cache_folder()
    if folder is None:
        return read_rest(part, read)
    facts = _facts(read, place, wanted)
    kept = _find(folder, facts)
    if kept is not None:
        return kept
    with folder.alone(_KIND, facts) as is_alone:
        if part is None or part.blocks is None:
            part = _find_part(folder, facts)
        kept, image = _find(folder, facts), None
        if kept is None:
            with suppress(OSError), folder.adding(_KIND, facts, resumes=is_alone) as entry:
                image = read_rest(part, read, entry=entry)
            folder.remove(_PART_KIND, facts)
            kept = _find(folder, facts) or image
    return kept or read_rest(part, read)


def read_plan(read: Callable[..., Image], place: Path | str, wanted: Mapping[str, Any]) -> Image:
    """Return a level of which nothing, or some part, is read, by which its place and its shape are known.

    For a level of a local store in the cache folder, no process is started. read: reads the level in a child process.
    """
    folder = cache_folder()
    if folder is None or isinstance(place, str):
        return read(blocks=())
    facts = _facts(read, place, wanted)
    return _find_part(folder, facts) or _find(folder, facts) or read(blocks=())


def read_part_kept(
    part: Image, blocks: Blocks, read: Callable[..., Image], place: Path | str, wanted: Mapping[str, Any]
) -> Image:
    """Return a part of a level with more blocks, as `with_blocks`, from the cache folder as far as they are there.

    It is kept if the process has such a folder. It takes the place of the part that an earlier process has kept, and
    has its file, to which blocks are added: a process that has mapped the file looks at its own blocks alone.
    """
    folder = cache_folder()
    if folder is None:
        return with_blocks(part, blocks, read)
    facts, image = _facts(lambda **_: part, place, wanted), None
    with folder.alone(_PART_KIND, facts) as is_alone:
        if part.blocks is None:
            part = _find_part(folder, facts) or part
        if has_blocks(part, blocks):
            return part
        with suppress(OSError), folder.adding(_PART_KIND, facts, resumes=is_alone) as entry:
            is_shared = share_voxels(part, entry)
            image = with_blocks(part, blocks, partial(read, entry=entry), is_shared=is_shared)
            assert image.blocks is not None
            np.save(entry / f"{_BLOCKS}.npy", image.blocks.wanted, allow_pickle=False)
            folder.remove(_PART_KIND, facts)
    return image or with_blocks(part, blocks, read)


def find_kept(plan: Image, place: Path | str, wanted: Mapping[str, Any]) -> Image | None:
    """Return a level from the cache folder; None if it is not there. plan: the level, with or without voxels."""
    folder = cache_folder()
    return None if folder is None else _find(folder, _facts(lambda **_: plan, place, wanted))


def store_state(read_plan: Callable[[], Image], place: Path | str) -> object:
    """Return facts that change when a store does. read_plan: reads a level without voxels."""
    return (str(place), store_marks(place)) if isinstance(place, Path) else (place, _stated(read_plan()))


@contextmanager
def looking_once() -> Iterator[None]:
    """Look at the files of each store once while the block runs: marks count from then on until its end.

    An entry that is kept meanwhile has the marks of a time before its voxels were read, and is not found again if a
    file has changed since.
    """
    before = _KNOWN_MARKS.set({})
    try:
        yield
    finally:
        _KNOWN_MARKS.reset(before)


def store_marks(place: Path) -> str:
    """Return a text that changes when a file in a store is added, removed or written to. place: a folder or a file."""
    known = _KNOWN_MARKS.get()
    if known is None:
        return find_marks(place)
    if place not in known:
        known[place] = find_marks(place)
    return known[place]


def find_marks(place: Path) -> str:
    """Return the marks of a store, as `store_marks`, by a look at its files."""
    total, folders = 0, [place] if place.is_dir() else []
    marks = repr(marks_of(place)) * place.is_file()
    while folders:
        here = folders.pop()
        with os.scandir(here) as entries:
            for each in entries:
                if each.is_dir(follow_symlinks=False):
                    folders.append(Path(each.path))
                    continue
                state = each.stat()
                times = f"{state.st_mtime_ns} {state.st_ctime_ns}"
                text = f"{each.path} {state.st_size} {times}".encode("utf-8", "surrogateescape")
                # A sum does not depend on the order of the files, which the system chooses.
                total += int.from_bytes(hashlib.blake2b(text, digest_size=_DIGEST_BYTES).digest(), "big")
    return f"{marks} {total % 256**_DIGEST_BYTES:x}"


def _facts(read: Callable[..., Image], place: Path | str, wanted: Mapping[str, Any]) -> object:
    """Return the facts that a level depends on."""
    marks: object = None if isinstance(place, str) else store_marks(place)
    if marks is not None and wanted["level"] is not None:
        return str(place), marks, tuple(wanted.items())
    plan = read(blocks=())  # the level that is taken if none is named depends on the free memory
    return str(place), marks or _stated(plan), tuple(wanted.items()), plan.levels


def _stated(plan: Image) -> object:
    """Return the metadata of a store, as far as its levels depend on them."""
    return plan.marks, plan.values.dtype.str, plan.levels, plan.notes


def _find_part(folder: CacheFolder, facts: object) -> Image | None:
    """Return the part of a level in an entry of the cache folder. An entry that holds no part is removed."""
    found = folder.find(_PART_KIND, facts)
    image = None if found is None else kept_image(found)
    if found is None or image is None or image.box is None or _BLOCKS not in found:
        folder.remove(_PART_KIND, facts)
        return None
    blocks, wanted = Blocks.of_level(level_read(image)), found[_BLOCKS]
    fits = wanted.shape == blocks.wanted.shape and image.values.shape == blocks.shape_in(image.box)
    if not fits or wanted.dtype != np.bool_:
        folder.remove(_PART_KIND, facts)
        return None
    return replace(image, blocks=replace(blocks, wanted=np.array(wanted)))


def _find(folder: CacheFolder, facts: object) -> Image | None:
    """Return the level in an entry of the cache folder. An entry that holds no image is removed."""
    found = folder.find(_KIND, facts)
    if found is None:
        return None
    image = kept_image(found)
    if image is None:
        folder.remove(_KIND, facts)
    return image
