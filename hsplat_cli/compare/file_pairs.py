"""Pairs the frames of two pictures, folders, templates or films."""

from __future__ import annotations

import contextlib
import re
import unicodedata
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from hsplat_cli.compare.frame_comparison import compare_frame
from hsplat_cli.compare.limit import Limit
from hsplat_cli.compare.outcome import ComparedFilm, ComparedFrame
from hsplat_cli.compare.picture_file import MAX_PIXELS, decode_picture, file_content, is_picture, read_picture
from hsplat_cli.compare.report_folder import PictureStore
from hsplat_cli.terminal import Reporter
from renderer.errors import InputError, Problem, SceneError
from renderer.film import (
    ANY_FRAME_FIELD,
    Pixels,
    count_film_frames,
    decode_film,
    folder_files,
    frame_path,
)
from renderer.readers import natural_sort_key
from renderer.scene import (
    FILM_SUFFIXES,
    FRAME_FIELD,
    counted,
    first_few,
    is_same_file,
    missing_file_error,
    nearest_file_hint,
)

# Suffixes of picture files that are not compared; a note lists such files.
_OTHER_SUFFIXES = (".jpg", ".jpeg", ".webp", ".tif", ".tiff", ".bmp")

# The kinds of paths that can be compared, as messages name them.
_FOLDER = "a folder"
_TEMPLATE = "a template of frames"
_PICTURE = "a PNG picture"
_EXPECTED = "two folders or templates of PNG files, two PNG pictures, or two films in one format"
# The suffixes of scenes, which a folder of pictures lacks.
_SCENE_SUFFIXES = (".yaml", ".yml")
# A number in the name of a frame.
_DIGITS = re.compile("[0-9]{1,9}")
# Largest number of unreadable frames that a message lists.
_MAX_ERRORS_SHOWN = 10


class _Pair(NamedTuple):
    """A golden frame and the actual one: uint8 [h, w, 3 or 4], straight alpha; None for a side without the frame."""

    name: str
    golden: Pixels | None
    actual: Pixels | None


class _Pairs(NamedTuple):
    """All pairs of two sets of pictures, read one at a time, in the order of `names`.

    Iterating over `pairs` raises InputError if a frame cannot be read.
    """

    names: Sequence[str]
    pairs: Iterator[_Pair]
    notes: Sequence[str] = ()


def is_picture_set(place: str) -> bool:
    """Return whether a place is a picture, a film, a template, or a folder with pictures and without scenes."""
    path = Path(place)
    if path.is_dir():
        return not any(each.suffix.lower() in _SCENE_SUFFIXES for each in folder_files(path))
    return path.suffix.lower() not in (*_SCENE_SUFFIXES, ".json")


def compare_files(golden: Path, actual: Path, limit: Limit, store: PictureStore, reporter: Reporter) -> ComparedFilm:
    """Compare the pictures of two paths, and keep those of both sides in a report if a frame fails.

    The paths are as in `_open_pairs`. Raises InputError if nothing can be compared.
    """
    with _open_pairs(golden, actual) as pairs, reporter.progress(len(pairs.names), label="comparing") as bar:
        frames = list[ComparedFrame]()
        for name, old, new in pairs.pairs:
            frame, file = compare_frame(name, old, new, limit), f"{len(frames):04}.png"
            number = _DIGITS.findall(name)
            frames.append(
                replace(
                    frame,
                    frame=int(number[-1]) if number else None,
                    old=None if old is None else store.add("old", file, old),
                    new=None if new is None else store.add("new", file, new),
                )
            )
            bar.advance()
    film = ComparedFilm(f"{golden} and {actual}", str(limit), notes=tuple(pairs.notes), frames=tuple(frames))
    return store.settled(film)


@contextlib.contextmanager
def _open_pairs(golden: Path, actual: Path) -> Iterator[_Pairs]:
    """Pair the frames of two paths. Raises InputError if nothing can be compared.

    Each path is a PNG picture; a folder, whose PNG files are paired by name; a template such as
    `frames/{frame:04}.png`, whose files are paired by number, or by name with files of a folder; or a film, whose
    frames are paired by index.
    """
    kinds = _kind(golden), _kind(actual)
    in_folders = set(kinds) <= {_FOLDER, _TEMPLATE}
    if kinds[0] != kinds[1] and not in_folders:
        got = f"{golden}, {kinds[0]}; {actual}, {kinds[1]}"
        raise InputError("GOLDEN and ACTUAL are of different kinds", got=got, expected=_EXPECTED)
    if in_folders:
        goldens, actuals = _files_by_pair(golden, actual, kinds)
        notes = [*_ignored_notes(golden, goldens.values()), *_ignored_notes(actual, actuals.values())]
        yield _file_pairs(goldens, actuals, golden, actual, notes)
    elif kinds[0] == _PICTURE:
        yield _file_pairs({golden.name: golden}, {golden.name: actual}, golden, actual)
    else:
        with _open_films(golden, actual) as pairs:
            yield pairs


def _kind(path: Path) -> str:
    try:
        is_folder, is_there = path.is_dir(), path.exists()
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else None
        raise InputError(f"cannot be read: {reason or error}", where=str(path)) from error
    if is_folder:
        return _FOLDER
    if ANY_FRAME_FIELD.search(str(path)):
        return _TEMPLATE
    suffix = path.suffix.lower()
    if not is_there:
        raise missing_file_error(path, "no such file or folder")
    if suffix in FILM_SUFFIXES:
        return f"a film in {suffix}"
    if suffix == ".png":
        return _PICTURE
    raise InputError(
        "cannot be compared", where=str(path), got=f"a file in {suffix or 'no format'}", expected=_EXPECTED
    )


def _files_by_pair(golden: Path, actual: Path, kinds: tuple[str, str]) -> Sequence[dict[str, Path]]:
    """Return the golden and the actual files, each by the name of its pair."""
    if kinds == (_TEMPLATE, _TEMPLATE):
        return [
            {frame_path(golden, number).name: path for number, path in _template_files(template).items()}
            for template in (golden, actual)
        ]
    return [
        {path.name: path for path in _template_files(side).values()} if kind == _TEMPLATE else _in_folder(side)
        for side, kind in zip((golden, actual), kinds, strict=True)
    ]


def _in_folder(folder: Path) -> dict[str, Path]:
    paths = _entries(folder)
    found = {path.name: path for path in paths if is_picture(path.name)}
    if not found:
        folders = list(filter(_has_pictures, paths))
        raise InputError(
            "no PNG files in this folder",
            where=str(folder),
            got=counted(len(paths), "other file") if paths else "an empty folder",
            hint=f"{folders[0]} has some" if folders else None,
        )
    return found


def _template_files(template: Path) -> dict[int, Path]:
    """Return the files that match a template, by frame number."""
    name, pattern = Path(template.name), _pattern(template)
    found = {}
    for path in _entries(template.parent):
        match = pattern.fullmatch(path.name)
        if match and frame_path(name, int(match[1])).name == path.name:
            found[int(match[1])] = path
    if not found:
        raise InputError("no file matches this template", where=str(template), hint=nearest_file_hint(template))
    return found


def _pattern(template: Path) -> re.Pattern[str]:
    """Return a pattern of the template's file names, with any number of digits."""
    name = template.name
    rest, num_fields = FRAME_FIELD.subn("", str(template))
    if num_fields != 1 or not FRAME_FIELD.search(name) or "{" in rest or "}" in rest:
        expected = "one {frame} or {frame:04}, in the name of the files, and no other braces"
        raise InputError("not a valid template", where=str(template), expected=expected)
    before, after = (re.escape(part) for part in FRAME_FIELD.sub("\0", name).split("\0"))
    return re.compile(f"{before}([0-9]+){after}", re.DOTALL)


def _ignored_notes(side: Path, compared: Collection[Path]) -> Iterator[str]:
    """Yield notes on pictures that are not compared although they look like frames."""
    if not side.is_dir():
        pattern = _pattern(side)
        others = [path for path in _entries(side.parent) if pattern.fullmatch(path.name) and path not in compared]
        if others:
            yield f"not compared, because {side.name} has another number of digits: {_some(others)}"
        return
    visible = [path for path in _entries(side) if not path.name.startswith(".")]
    others = [path for path in visible if path.suffix.lower() in _OTHER_SUFFIXES]
    if others:
        yield f"not compared, because they are not PNG files: {_some(others)} in {side}"
    folders = [path for path in visible if _has_pictures(path)]
    if folders:
        yield f"not compared, because subfolders are ignored: PNG files in {_some(folders)} in {side}"


def _has_pictures(path: Path) -> bool:
    return any(is_picture(below.name) for below in folder_files(path))


def _some(paths: Iterable[Path]) -> str:
    return first_few([path.name for path in paths])


def _entries(folder: Path) -> list[Path]:
    try:
        return sorted(folder.iterdir())
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", where=str(folder)) from error


def _file_pairs(
    goldens: Mapping[str, Path], actuals: Mapping[str, Path], golden: Path, actual: Path, notes: Sequence[str] = ()
) -> _Pairs:
    names = sorted({**goldens, **actuals}, key=natural_sort_key)
    both = [name for name in names if name in goldens and name in actuals]
    if not both:
        hint = "they look alike, but their accents are different code points"
        raise InputError(
            "no frame of ACTUAL has the name of a golden",
            where=str(actual),
            got=_first_names(actuals),
            expected=f"{_first_names(goldens)}, as in {golden}",
            hint=hint if _differ_in_normalization(goldens, actuals) else None,
        )
    links = [name for name in both if is_same_file(goldens[name], actuals[name])]
    if len(links) == len(both):
        raise _same_files_error(actual)
    if links:
        words = "1 frame of ACTUAL is a link" if len(links) == 1 else f"{len(links)} frames of ACTUAL are links"
        notes = [f"{words} to the golden: {_first_names(links)}", *notes]
    return _Pairs(names, _read_pairs(names, goldens, actuals), notes)


def _read_pairs(names: Sequence[str], goldens: Mapping[str, Path], actuals: Mapping[str, Path]) -> Iterator[_Pair]:
    """Read the pictures of both sides, by the names of their pairs.

    Raises SceneError with all pictures that cannot be read.
    """
    unreadable: list[InputError] = []
    for name in names:
        try:
            pictures = _pictures(goldens.get(name), actuals.get(name))
        except InputError as error:
            unreadable.append(error)
            continue
        if not unreadable:  # after an error, later files are read only to report all errors at once
            yield _Pair(name, *pictures)
    if unreadable:
        num_more = len(unreadable) - _MAX_ERRORS_SHOWN
        more = [Problem("", f"... and {counted(num_more, 'more frame')} that cannot be read")] if num_more > 0 else []
        shown = unreadable[:_MAX_ERRORS_SHOWN]
        problems = [Problem("", each.what, each.got, each.expected, each.hint, location=each.where) for each in shown]
        raise SceneError([*problems, *more])


def _first_names(names: Iterable[str]) -> str:
    return first_few(list(map(repr, sorted(names, key=natural_sort_key))))


def _differ_in_normalization(goldens: Iterable[str], actuals: Iterable[str]) -> bool:
    """Return whether names differ only in Unicode normalization, which some file systems change."""
    composed, others = ({unicodedata.normalize("NFC", name) for name in names} for names in (goldens, actuals))
    return bool(composed & others)


def _same_files_error(actual: Path) -> InputError:
    hint = "files are not compared with themselves, or with links to themselves"
    return InputError("GOLDEN and ACTUAL are the same files", where=str(actual), hint=hint)


def _pictures(golden: Path | None, actual: Path | None) -> tuple[Pixels | None, Pixels | None]:
    """Return the golden and the actual picture, None for a side without a file; equal bytes are decoded once."""
    if golden is None or actual is None:
        return (None if golden is None else read_picture(golden)), (None if actual is None else read_picture(actual))
    content, other = file_content(golden), file_content(actual)
    picture = decode_picture(content, golden)
    return picture, picture if other == content else decode_picture(other, actual)


@contextlib.contextmanager
def _open_films(golden: Path, actual: Path) -> Iterator[_Pairs]:
    if is_same_file(golden, actual):
        raise _same_files_error(actual)
    num_goldens, num_actuals = (count_film_frames(film, MAX_PIXELS) for film in (golden, actual))
    if num_goldens != num_actuals:
        raise InputError(
            "films with different numbers of frames",
            where=str(actual),
            got=counted(num_actuals, "frame"),
            expected=f"{counted(num_goldens, 'frame')}, as in {golden}",
        )
    if num_goldens == 0:
        raise InputError("a film without frames", where=str(golden))
    names = [f"frame {number}" for number in range(num_goldens)]
    notes = (
        f"{golden.suffix.lower()} films are lossy, and the result depends on the encoder's version: "
        "PNG frames are better goldens",
        "only the pictures of films are compared, not their timing",
    )
    with decode_film(golden, MAX_PIXELS) as goldens, decode_film(actual, MAX_PIXELS) as actuals:
        yield _Pairs(names, map(_Pair, names, goldens, actuals), notes)
