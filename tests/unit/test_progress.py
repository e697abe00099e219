"""Progress: lines that neither flood a log nor stop, one line on a terminal, silence on request."""

import io
import re
import sys

import numpy as np
import pytest

from hsplat_cli.terminal import PassProgress, Progress, Reporter
from renderer.volume import iter_slabs, map_slabs, watched_passes


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def shown(steps: int | list[float], seconds: list[float], stream: io.StringIO, unit: str = "frames") -> str:
    """Return what is shown of steps that take these seconds; the note of each is its duration."""
    now = [100.0]
    progress = Progress(steps, "engine.mp4", stream, lambda: now[0], unit)
    for each in seconds:
        now[0] += each
        progress.advance(f"{each} s" if unit == "settings" else "")
    progress.close()
    return stream.getvalue()


def lines_of(total: int, seconds_a_frame: float) -> list[str]:
    return shown(total, [seconds_a_frame] * total, io.StringIO()).splitlines()


def test_a_line_for_each_tenth() -> None:
    lines = lines_of(total=120, seconds_a_frame=0.25)
    assert len(lines) == 10
    assert lines[0] == "engine.mp4: 12/120 frames, 4.00 frames/s, 0:27 left"
    assert lines[-1] == "engine.mp4: 120/120 frames, 4.00 frames/s"


def test_the_time_left_does_not_count_the_start_for_each_frame() -> None:
    assert shown(20, [10, 2], io.StringIO()) == "engine.mp4: 2/20 frames, 0.17 frames/s, 0:36 left\n"


def test_a_fast_film_prints_at_most_a_line_in_two_seconds() -> None:
    assert len(lines_of(total=120, seconds_a_frame=0.05)) == 3
    assert len(lines_of(total=120, seconds_a_frame=0.0001)) == 1


def test_a_slow_film_prints_a_line_every_minute() -> None:
    lines = lines_of(total=1000, seconds_a_frame=20)
    assert lines[0] == "engine.mp4: 3/1000 frames, 0.05 frames/s, 5:32:20 left"
    assert len(lines) == 334


def test_steps_of_unequal_work_have_a_time_left_and_no_rate() -> None:
    assert shown([1.0, 3.0, 16.0], [3, 9, 40], io.StringIO(), "settings").splitlines() == [
        "engine.mp4: 2/3 settings, 0:48 left, 9 s",  # the first step was too small a part of the work for a line
        "engine.mp4: 3/3 settings, 40 s",
    ]


@pytest.mark.parametrize("stream", [io.StringIO(), Terminal()])
def test_steps_without_work_have_no_time_left(stream: io.StringIO) -> None:
    text = shown([0.0, 0.0], [100, 100], stream)
    assert "1/2 frames" in text and "2/2 frames" in text and "left" not in text


def test_a_terminal_has_one_line_that_is_rewritten(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "61")
    start, *lines = shown([1.0, 3.0], [5, 10], Terminal(), "settings").rstrip("\n").split("\r")
    assert start == ""
    assert lines == [
        f"engine.mp4:   0% [{20 * ' '}] 0/2 settings".ljust(60),
        f"engine.mp4:  25% [{'#####':20}] 1/2 settings, 0:15 left, 5 s"[:60],
        f"engine.mp4: 100% [{20 * '#'}] 2/2 settings, 10 s".ljust(60),
    ]
    assert len(shown(1000, [0.001] * 1000, Terminal()).split("\r")) < 15


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0.4, "0:00"), (7.4, "0:07"), (59.6, "1:00"), (754, "12:34"), (3723, "1:02:03"), (90000, "25:00:00")],
)
def test_durations(seconds: float, text: str) -> None:
    """Half of the work is done, so that as much time is left."""
    assert (
        shown([1.0, 1.0], [seconds], Terminal(), "settings")
        .split("\r")[-1]
        .strip()
        .endswith(f", {text} left, {seconds} s")
    )


@pytest.mark.parametrize("is_quiet", [True, False])
def test_progress_goes_to_the_error_stream_or_nowhere(is_quiet: bool, capsys, monkeypatch) -> None:
    for is_terminal in (False, True):
        monkeypatch.setattr(sys.stderr, "isatty", lambda is_terminal=is_terminal: is_terminal)
        with Reporter(is_quiet).progress(1, label="film") as bar:
            bar.advance("a note")
        out, err = capsys.readouterr()
        assert out == ""
        assert ("1/1 frames" in err and ", a note" in err) != is_quiet
        assert bool(err) != is_quiet


@pytest.mark.parametrize("stream", [io.StringIO(), Terminal()], ids=["log", "terminal"])
def test_the_progress_of_a_film_of_any_name_is_printable(stream: io.StringIO) -> None:
    progress = Progress(1, "\x1b[2J\u202e\nengine.mp4: done\r", stream)
    progress.advance("\x1b[31m")
    progress.close()
    pieces = list(filter(None, re.split("[\r\n]", stream.getvalue())))
    assert pieces
    assert all(piece.isprintable() for piece in pieces)
    assert all(piece.startswith(r"\x1b[2J\u202e\nengine.mp4: done\r: ") for piece in pieces)


def passes_shown(stream: io.StringIO, *seconds: float) -> str:
    """Return what is shown of passes over 4.5 MiB that take these seconds, a fifth for each MiB or part of it."""
    now, size = [0.0], 9 << 19
    progress = PassProgress(stream, lambda: now[0])
    for each in seconds:
        progress(0, size, "level 1")
        for done in range(1, 6):
            now[0] += each / 5
            progress(min(done << 20, size), size, "level 1")
    progress.close()
    return stream.getvalue()


def test_passes_over_voxels_are_shown_once_they_take_a_second() -> None:
    assert passes_shown(io.StringIO(), 0.9, 0.9) == passes_shown(Terminal(), 0.9, 0.9) == ""
    assert passes_shown(io.StringIO(), 0.9, 2.0, 0.5) == "reading level 1: 5/5 MiB, 2.50 MiB/s\n"
    on_terminal = passes_shown(Terminal(), 2.0, 0.5)
    assert on_terminal.count("\r") == 3 and on_terminal.count("\n") == 1 and "3/5 MiB" in on_terminal


@pytest.mark.parametrize("shape", [(5, 40, 30), (6000,), (1, 1, 1)])
def test_passes_tell_their_bytes(shape: tuple[int, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("renderer.volume.slabs._SLAB_BYTES_OF_THREAD", 5000)
    values, told = np.ones(shape, np.float32), list[tuple[int, int, str]]()
    with watched_passes(lambda *each: told.append(each)):
        assert sum(each.size for each in iter_slabs(values, None, 5000)) == values.size
        by_one, told[:] = [*told], []
        assert sum(map_slabs(lambda _, slab: slab.size, values, None)) == values.size
    map_slabs(lambda _, slab: slab.size, values, None)  # nobody watches
    assert by_one == told and told == sorted(told)
    assert told[0] == (0, values.nbytes, "voxels") and told[-1] == (values.nbytes, values.nbytes, "voxels")
