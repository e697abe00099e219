"""The lock of an output keeps other processes and threads out, and leaves nothing when its process ends."""

from __future__ import annotations

import errno
import fcntl
import os
import stat
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, ExitStack
from pathlib import Path

import pytest
from commands import other_process, python
from descriptors import open_files

from renderer.errors import HsplatError, InputError, OutputLockedError, RenderError
from renderer.film import lock_slots

OUTPUT = Path("film.mp4")
IMPORT = "from renderer.film import lock_slots"

# Holds the place and makes a file that nobody else may have made; a new one each time.
CONTENDER = """\
import os, sys
from pathlib import Path
from renderer.errors import InputError
from renderer.film import lock_slots
folder, place, num_times, wanted = Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]), sys.argv[4]
num_held = num_refused = 0
while num_held < num_times:
    try:
        with lock_slots(folder, [place], Path("film.mp4")):
            mine = folder.parent / f"only-one-has-{place}"
            os.close(os.open(mine, os.O_CREAT | os.O_EXCL))
            assert (folder / "lock").is_file()
            mine.unlink()
            num_held += 1
    except InputError:
        num_refused += 1
        assert wanted == "same", "refused for another place"
"""


def block(folder: Path, *places: int) -> str:
    return f"lock_slots(Path({str(folder)!r}), {list(places)}, Path('film.mp4'))"


def held(folder: Path, *places: int) -> AbstractContextManager[int]:
    """Another process, whose number this gives, holds these places."""
    return other_process(IMPORT, block(folder, *places))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "film.mp4.unfinished"


def take(folder: Path, places: Sequence[int]) -> None:
    with lock_slots(folder, places, OUTPUT):
        assert (folder / "lock").is_file()


def test_it_makes_its_folder_and_removes_it(folder: Path) -> None:
    take(folder.parent / "deeper" / "still", [0])
    assert not (folder.parent / "deeper" / "still").exists()
    take(folder, [0])
    take(folder, [0])


def test_a_folder_with_something_in_it_stays(folder: Path) -> None:
    """Its lock file shows that it is ours."""
    for _ in range(2):
        with lock_slots(folder, [0], OUTPUT):
            for name in ("000000.json", ".film.mp4.partial-0a1b2c3d", ".film.mp4.partial-mine"):
                (folder / name).touch()
        assert sorted(path.name for path in folder.iterdir()) == [".film.mp4.partial-mine", "000000.json", "lock"]


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_however_the_block_ends(folder: Path, error: type[BaseException]) -> None:
    with pytest.raises(error), lock_slots(folder, [0], OUTPUT):
        raise error
    assert not folder.exists()


def test_no_file_stays_open(folder: Path) -> None:
    with held(folder, 0), pytest.raises(InputError):
        take(folder, [0])
    take(folder, [0])
    assert not open_files(folder)


@pytest.mark.parametrize(("theirs", "ours"), [([0], [0]), ([2, 4, 6], [1, 3, 4]), ([999_999], [5, 999_999])])
def test_places_that_overlap(folder: Path, theirs: Sequence[int], ours: Sequence[int]) -> None:
    with held(folder, *theirs) as number:
        with pytest.raises(InputError) as caught:
            take(folder, ours)
        assert str(caught.value) == (
            f"film.mp4: another job is writing this output\n  got: process {number} on {os.uname().nodename}\n"
            "  hint: wait until it has finished, or choose another output"
        )
        assert (folder / "lock").is_file()
    assert not folder.exists()
    take(folder, ours)


@pytest.mark.parametrize(("theirs", "ours"), [([0, 2, 4], [1, 3, 5]), ([7], [0, 1, 2, 3, 4, 5, 6, 8])])
def test_places_that_do_not_overlap(folder: Path, theirs: Sequence[int], ours: Sequence[int]) -> None:
    with held(folder, *theirs):
        take(folder, ours)
        with pytest.raises(InputError):
            take(folder, [*theirs])
        (folder / ".theirs.partial-0a1b2c3d").touch()
        take(folder, ours)
        assert (folder / ".theirs.partial-0a1b2c3d").exists(), "it may be at work on it"
    assert not folder.exists()


def test_the_first_to_come_may_be_the_first_to_go(folder: Path) -> None:
    with ExitStack() as second:
        with held(folder, 0):
            second.enter_context(lock_slots(folder, [1], OUTPUT))
        assert (folder / "lock").is_file()
        with held(folder, 0):
            pass
    assert not folder.exists()


@pytest.mark.parametrize(
    "content", [None, b"", b"process 7 on a machine", b"process 7 on h and the end of a longer note"]
)
def test_what_a_job_leaves_that_is_killed_as_it_begins(folder: Path, content: bytes | None) -> None:
    folder.mkdir()
    if content is not None:
        (folder / "lock").write_bytes(content)
    take(folder, [0])
    assert not folder.exists()


@pytest.mark.parametrize(
    "files",
    [
        {"000000.png": b"mine"},
        {"lock": b"mine"},
        {"lock": b"", "000000.png": b"mine"},
        {"lock": b"mine", "000000.json": b"{}", ".film.mp4.partial-0a1b2c3d": b""},
    ],
)
def test_a_folder_that_somebody_else_made(folder: Path, files: dict[str, bytes]) -> None:
    folder.mkdir()
    for name, content in files.items():
        (folder / name).write_bytes(content)
    with pytest.raises(InputError) as caught:
        take(folder, [0])
    assert str(caught.value) == (
        f"{folder}: something else has the name of the folder for unfinished frames\n"
        "  got: a folder with files, and without the lock file of a job\n"
        "  hint: rename it, or choose another --output"
    )
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == files


def test_a_lock_file_that_somebody_else_wrote(tmp_path: Path) -> None:
    (tmp_path / ".x.lock").write_bytes(b"mine")
    with (
        pytest.raises(
            InputError, match="something else has the name of the lock file\n  got: a file of another program"
        ),
        lock_slots(tmp_path, [0], OUTPUT, shared_file=".x.lock"),
    ):
        pytest.fail("it would be emptied")
    assert (tmp_path / ".x.lock").read_bytes() == b"mine"


@pytest.mark.parametrize("kind", ["same", "own"])
def test_processes_that_take_turns(folder: Path, kind: str) -> None:
    """Neither do two ever hold one place, nor is anybody refused because another one comes or goes."""
    num_times = 40

    def contend(number: int) -> tuple[int, str]:
        place = number if kind == "own" else 0
        done = python("-c", CONTENDER, str(folder), str(place), str(num_times), kind)
        return done.returncode, done.stderr

    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(contend, range(4))) == [(0, "")] * 4
    assert list(folder.parent.iterdir()) == []


def test_threads_of_one_process_exclude_each_other(folder: Path) -> None:
    """The refused one neither takes the lock away from the other, nor its folder."""
    with ThreadPoolExecutor(1) as pool:
        with lock_slots(folder, [0, 1], OUTPUT):
            for _ in range(2):
                with pytest.raises(OutputLockedError):
                    pool.submit(take, folder, [1, 2]).result()
            pool.submit(take, folder, [2]).result()
            refused = python("-c", f"from pathlib import Path\n{IMPORT}\nwith {block(folder, 1)}: pass")
            assert "OutputLockedError" in refused.stderr
        pool.submit(take, folder, [1]).result()
    assert not folder.exists()


def test_a_lock_file_in_a_folder_for_other_things(tmp_path: Path) -> None:
    """The folder, which may be a link, and the files in it stay."""
    (tmp_path / "films").mkdir()
    (tmp_path / "link").symlink_to("films")
    (tmp_path / "films" / ".a.partial-0a1b2c3d").touch()
    with lock_slots(tmp_path / "link", [0], OUTPUT, shared_file=".x.lock"):
        assert (tmp_path / "films" / ".x.lock").is_file()
        (tmp_path / "films" / ".x.lock").unlink()
        (tmp_path / "films" / ".x.lock").touch()  # the file of another process now
    assert sorted(path.name for path in (tmp_path / "films").iterdir()) == [".a.partial-0a1b2c3d", ".x.lock"]


def test_a_file_system_without_locks(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*arguments: object) -> None:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr(fcntl, "fcntl", refuse)
    with lock_slots(folder, [0], OUTPUT):
        (folder / ".theirs.partial-0a1b2c3d").touch()
        (folder / "000001.json").touch()
        with held(folder, 0):
            take(folder, [0])
            assert (folder / ".theirs.partial-0a1b2c3d").exists(), "nobody knows who is at work"
        for path in folder.iterdir():
            path.unlink()
    assert not folder.exists()


def test_locks_that_fail(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*arguments: object) -> None:
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    monkeypatch.setattr(fcntl, "fcntl", refuse)
    with pytest.raises(RenderError, match=r"film\.mp4: the output cannot be written\n  got: Input/output error"):
        take(folder, [0])


def test_a_folder_that_was_made_again_is_left_to_who_made_it(folder: Path) -> None:
    with ExitStack() as stack:
        with lock_slots(folder, [0], OUTPUT):
            (folder / "lock").unlink()
            folder.rmdir()
            stack.enter_context(held(folder, 0))
        assert (folder / "lock").is_file()
    assert not folder.exists()


@pytest.mark.parametrize("kind", ["a file", "a link"])
def test_something_else_under_the_name_of_the_folder(folder: Path, kind: str) -> None:
    target = folder.parent / "target"
    target.mkdir()
    if kind == "a file":
        folder.write_bytes(b"content")
    else:
        folder.symlink_to(target)
    with pytest.raises(InputError) as caught:
        take(folder, [0])
    assert str(caught.value) == (
        f"{folder}: something else has the name of the folder for unfinished frames\n"
        f"  got: {kind}\n  hint: rename it, or choose another --output"
    )
    assert list(target.iterdir()) == []


@pytest.mark.parametrize(
    ("kind", "make"),
    [
        ("a link", lambda file: file.symlink_to("absent")),
        ("a folder", lambda file: file.mkdir()),
        ("a device or a pipe", os.mkfifo),
    ],
)
def test_something_else_under_the_name_of_a_lock_file(kind: str, make: Callable[[Path], None], tmp_path: Path) -> None:
    make(tmp_path / "lock")
    with pytest.raises(InputError) as caught:
        take(tmp_path, [0])
    assert str(caught.value) == (
        f"{tmp_path / 'lock'}: something else has the name of the lock file\n  got: {kind}\n  hint: rename or remove it"
    )
    assert [path.name for path in tmp_path.iterdir()] == ["lock"]


@pytest.mark.parametrize(
    ("of_folder", "of_file"), [(0o755, 0o600), (0o775, 0o660), (0o777, 0o666), (0o1777, 0o666), (0o707, 0o606)]
)
def test_who_may_write_the_folder_may_lock(of_folder: int, of_file: int, tmp_path: Path) -> None:
    """Whatever the umask of who comes first."""
    tmp_path.chmod(of_folder)
    before = os.umask(0o077)
    try:
        with lock_slots(tmp_path, [0], OUTPUT, shared_file="lock"):
            assert stat.S_IMODE((tmp_path / "lock").stat().st_mode) == of_file
    finally:
        os.umask(before)


def test_a_folder_that_cannot_be_made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is told, and not tried again and again."""
    link = tmp_path / "link"
    link.symlink_to(tmp_path / "absent" / "scratch")
    with (
        pytest.raises(InputError, match="the output folder is a broken link"),
        lock_slots(link / "a", [0], link / "film.mp4"),
    ):
        pytest.fail("there is no such folder")
    with pytest.raises(HsplatError), lock_slots(Path("/proc/absent/a"), [0], Path("/proc/absent/film.mp4")):
        pytest.fail("there is no such folder")
    gone = tmp_path / "gone"
    gone.mkdir()
    monkeypatch.chdir(gone)
    gone.rmdir()
    with pytest.raises(RenderError, match="has vanished"), lock_slots(Path("a"), [0], Path("film.mp4")):
        pytest.fail("there is no such folder")
