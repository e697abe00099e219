"""Sort slices in separate files by the numbers in their names, and check that they make up one stack."""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path

import numpy as np

from renderer.errors import InputError
from renderer.readers.sniff import natural_sort_key


def sort_slices(files: list[Path]) -> list[Path]:
    """Return the files in natural order, `2.tif` before `10.tif`.

    Raises InputError unless the names differ only in numbers, and one of the numbers increases from file to file in
        even steps: otherwise slices are missing, or there are several stacks.
    """
    files = sorted(files, key=lambda file: natural_sort_key(file.name))
    shapes = [re.sub("[0-9]+", "#", file.name.lower()) for file in files]
    for file, shape in zip(files, shapes, strict=True):
        if shape != shapes[0]:
            raise InputError(
                "the slices of this folder are named in several ways",
                got=f"{files[0].name} and {file.name}",
                expected="names that differ in one number, such as slice001.tif and slice002.tif",
                hint="put each stack into its own folder, or rename its files",
            )
    numbers = [[int(run) for run in re.findall("[0-9]+", file.name)] for file in files]
    running = [column for column in zip(*numbers, strict=True) if len(set(column)) > 1]
    if len(files) > 1 and not any(_is_even(column) for column in running):
        raise _uneven(files, running)
    return files


def require_alike(found: str, expected: str, first: Path) -> None:
    """Raise InputError if the description of a slice differs from that of the first slice."""
    if found != expected:
        raise InputError("the slices of this folder differ", got=found, expected=f"{expected} as in {first.name}")


def _is_even(column: tuple[int, ...]) -> bool:
    steps = {after - before for before, after in pairwise(column)}
    return len(steps) == 1 and min(steps) > 0


def _uneven(files: list[Path], running: list[tuple[int, ...]]) -> InputError:
    if len(running) > 1:
        return InputError(
            "the names of these slices have several increasing numbers",
            got=f"{files[0].name}, ..., {files[-1].name}",
            expected="one number, in even steps, such as slice001.tif and slice002.tif",
            hint="channels or time steps? put each stack into its own folder",
        )
    gaps = [after - before for before, after in pairwise(running[0])] if running else [0]
    if min(gaps) == 0:
        k = gaps.index(0)
        return InputError(
            "two slices of this folder have the same number",
            got=f"{files[k].name} and {files[k + 1].name}",
            expected="one file for each number",
        )
    usual = int(np.median(gaps))
    k = next(index for index, gap in enumerate(gaps) if gap != usual)
    return InputError(
        "slices of this folder are missing",
        got=f"{files[k + 1].name} after {files[k].name}",
        expected=f"numbers in steps of {usual}",
        hint="put the missing files back, or renumber the existing ones",
    )
