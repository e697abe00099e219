"""A folder of goldens changes as a whole, wherever a change is killed."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterable
from functools import partial
from itertools import count
from pathlib import Path
from typing import NoReturn

import pytest
from commands import other_process
from golden_samples import contents_of, picture, record_of

from hsplat_cli.compare import GOLDEN_RECORD, GoldenFolder, GoldenRecord, golden_file_name
from renderer.errors import HsplatError, InputError, OutputLockedError, RenderError
from renderer.film import encode_png

OLD = {frame: picture(frame) for frame in range(5)}
# Three frames are replaced, a frame is kept, a frame is removed, two frames are added.
NEW = {frame: picture(frame if frame == 3 else 100 + frame) for frame in range(7) if frame != 4}
CHANGED = {frame: pixels for frame, pixels in NEW.items() if frame != 3}
# The operations on files before which a change is killed, as Python's audit calls them.
EVENTS = ("open", "os.listdir", "os.mkdir", "os.remove", "os.rename", "os.rmdir", "os.scandir")


@pytest.fixture
def goldens(tmp_path: Path) -> GoldenFolder:
    folder = GoldenFolder(tmp_path / "goldens")
    folder.change(None, record_of(OLD), contents_of(OLD))
    return folder


def require_whole(folder: GoldenFolder) -> GoldenRecord:
    """Return the record of a folder, after requiring that its pictures are those that it describes."""
    record = folder.find()
    assert record is not None
    folder.unlisted(record)
    assert all(folder.holds(picture) for golden in record.frames for picture in golden.pictures)
    return record


def change(folder: GoldenFolder) -> None:
    folder.change(record_of(OLD), record_of(NEW), contents_of(CHANGED))


def files(folder: GoldenFolder) -> list[str]:
    return sorted(os.listdir(folder.path))


def names(pictures: Iterable[int]) -> list[str]:
    return [golden_file_name(frame, 10) for frame in pictures]


def test_a_change_replaces_adds_and_removes(goldens: GoldenFolder) -> None:
    (goldens.path / "notes.txt").touch()
    change(goldens)
    assert require_whole(goldens) == record_of(NEW)
    assert files(goldens) == [*names(NEW), "golden.json", "notes.txt"]


def killed_change(folder: GoldenFolder, place: int) -> bool:
    """Change a folder in a child that is killed before its operation on files of this number.

    Return whether it was killed, or came to its end.
    """
    child = os.fork()
    if child == 0:
        numbers = count(1)

        def kill(event: str, _: object) -> None:
            if event in EVENTS and next(numbers) == place:
                os.kill(os.getpid(), signal.SIGKILL)

        try:
            sys.addaudithook(kill)
            folder.change(folder.find(), record_of(NEW), contents_of(CHANGED))
        finally:
            os._exit(int(sys.exc_info()[0] is not None))
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    assert code in (0, -signal.SIGKILL)
    return code != 0


def old_goldens(path: Path) -> GoldenFolder:
    """Write the old goldens without the care of a change, which takes longer."""
    path.mkdir()
    for name, content in contents_of(OLD).items():
        (path / name).write_bytes(content())
    GOLDEN_RECORD.write(path / "golden.json", record_of(OLD))
    return GoldenFolder(path)


def test_a_kill_at_any_operation_leaves_the_old_or_the_new_goldens(tmp_path: Path) -> None:
    """After it, the next change finishes the work."""
    found = []
    for place in count(1):
        folder = old_goldens(tmp_path / str(place))
        if not killed_change(folder, place):
            break
        record = require_whole(folder)
        assert record in (record_of(OLD), record_of(NEW))
        found.append(record == record_of(NEW))
        after = {0: picture(20)}
        folder.change(record, record_of(after), contents_of(after))
        assert require_whole(folder) == record_of(after)
        assert files(folder) == ["frame-0000.png", "golden.json"]
    assert len(found) >= 20
    assert (found[0], found[-1]) == (False, True)
    assert found == sorted(found), "the change counts from one operation on"


@pytest.mark.slow
def test_two_kills_leave_no_mixture(tmp_path: Path) -> None:
    """The second one ends the change that finishes the first."""
    num_killed = 0
    for first in (14, 15, 18, 21):  # the change counts from 14 on
        for second in (2, 4, 6, 9):
            folder = old_goldens(tmp_path / f"{first}-{second}")
            num_killed += killed_change(folder, first) and killed_change(folder, second)
            assert require_whole(folder) in (record_of(OLD), record_of(NEW))
    assert num_killed >= 12


def fail(error: BaseException) -> NoReturn:
    raise error


@pytest.mark.parametrize("error", [KeyboardInterrupt(), InputError("an edited report"), OSError(28, "no space")])
def test_a_change_that_fails_changes_nothing(goldens: GoldenFolder, error: BaseException) -> None:
    contents = {"frame-0000.png": partial(encode_png, NEW[0]), "frame-0001.png": partial(fail, error)}
    with pytest.raises(RenderError if isinstance(error, OSError) else type(error)):
        goldens.change(record_of(OLD), record_of(NEW), contents)
    assert require_whole(goldens) == record_of(OLD)
    assert files(goldens) == [*names(OLD), "golden.json"]


def test_an_outdated_plan_is_refused(goldens: GoldenFolder) -> None:
    """Two programs planned a change of the same goldens; the first was quicker."""
    change(goldens)
    for before in (record_of(OLD), None):
        with pytest.raises(InputError, match="another program has changed these goldens"):
            goldens.change(before, record_of(OLD), contents_of(OLD))
    assert require_whole(goldens) == record_of(NEW)


def test_two_programs_do_not_change_a_folder_at_once(goldens: GoldenFolder) -> None:
    block = f"locked_files([Path({str(goldens.path / 'golden.json')!r})])"
    with other_process("from renderer.film import locked_files", block):
        for work in (partial(change, goldens), partial(goldens.require_changeable, [], [])):
            with pytest.raises(OutputLockedError):
                work()
    change(goldens)


def test_a_link_to_other_files_is_not_followed(goldens: GoldenFolder, tmp_path: Path) -> None:
    """A repository may hold any links: files of the user would be moved into the folder."""
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine/thesis.txt").touch()
    (goldens.path / "golden.ready").symlink_to(tmp_path / "mine")
    for work in (goldens.find, partial(change, goldens)):
        with pytest.raises(InputError, match="a link in a folder of goldens"):
            work()
    assert (tmp_path / "mine/thesis.txt").exists()


def test_links_in_place_of_pictures_are_replaced_not_followed(goldens: GoldenFolder, tmp_path: Path) -> None:
    mine = tmp_path / "mine.png"
    mine.write_bytes((goldens.path / "frame-0000.png").read_bytes())
    before = mine.read_bytes()
    (goldens.path / "frame-0000.png").unlink()
    (goldens.path / "frame-0000.png").symlink_to(mine)
    change(goldens)
    assert mine.read_bytes() == before
    assert require_whole(goldens) == record_of(NEW)


def test_pictures_that_the_record_has_lost_are_an_error(goldens: GoldenFolder) -> None:
    (goldens.path / "other.png").touch()
    assert goldens.unlisted(record_of(OLD)) == ["other.png"]
    with pytest.raises(InputError, match=r"does not list all goldens"):
        goldens.unlisted(record_of({0: OLD[0]}))


def test_files_of_other_pixels_are_not_held(goldens: GoldenFolder) -> None:
    (golden,) = record_of({0: OLD[0]}).frames
    path = goldens.path / "frame-0000.png"
    for content in (encode_png(OLD[1]), b"no picture", None):
        path.unlink()
        if content is not None:
            path.write_bytes(content)
        assert not goldens.holds(golden.pictures[0])


@pytest.mark.parametrize("name", ["golden.json", "frame-0000.png", "golden.making/scan.npy"])
def test_inputs_are_not_overwritten(goldens: GoldenFolder, name: str, tmp_path: Path) -> None:
    (goldens.path / "golden.making").mkdir()
    (goldens.path / "golden.making/scan.npy").touch()
    (tmp_path / "scan.npy").hardlink_to(goldens.path / name)
    with pytest.raises(HsplatError, match="would overwrite an input"):
        goldens.require_changeable(["frame-0000.png"], [tmp_path / "scan.npy"])
    goldens.require_changeable(["frame-0001.png"], [goldens.path / "frame-0002.png"])


def test_a_file_in_place_of_the_folder(tmp_path: Path) -> None:
    (tmp_path / "goldens").touch()
    folder = GoldenFolder(tmp_path / "goldens/a")
    assert folder.find() is None
    for work in (partial(folder.require_changeable, [], []), partial(folder.change, None, record_of(OLD), {})):
        with pytest.raises(InputError, match="the output folder is a file"):
            work()
