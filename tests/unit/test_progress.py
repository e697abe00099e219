"""Progress: lines that neither flood a log nor stop, a bar on a terminal, silence on request."""

import io
import subprocess
import sys

import pytest

from hsplat_cli.terminal import Reporter
from hsplat_cli.terminal.progress_bar import ProgressLines, format_duration


class Clock:
    """Seconds that pass when told."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


def lines_of(total: int, seconds_a_frame: float) -> list[str]:
    clock, stream = Clock(), io.StringIO()
    lines = ProgressLines(total, "engine.mp4", stream, clock)
    for _ in range(total):
        clock.now += seconds_a_frame
        lines.advance()
    return stream.getvalue().splitlines()


def test_a_line_for_each_tenth() -> None:
    lines = lines_of(total=120, seconds_a_frame=0.25)
    assert len(lines) == 10
    assert lines[0] == "engine.mp4: 12/120 frames, 4.00 frames/s, 0:27 left"
    assert lines[-1] == "engine.mp4: 120/120 frames, 4.00 frames/s"


def test_the_start_is_not_counted_as_if_each_frame_had_one() -> None:
    clock, stream = Clock(), io.StringIO()
    lines = ProgressLines(20, "engine.mp4", stream, clock)
    for seconds in (10, 2):
        clock.now += seconds
        lines.advance()
    assert stream.getvalue().splitlines() == ["engine.mp4: 2/20 frames, 0.17 frames/s, 0:36 left"]


def test_never_more_than_one_in_two_seconds() -> None:
    assert len(lines_of(total=120, seconds_a_frame=0.05)) == 3
    assert len(lines_of(total=120, seconds_a_frame=0.0001)) == 1


def test_a_slow_film_shows_life_every_minute() -> None:
    lines = lines_of(total=1000, seconds_a_frame=20)
    assert lines[0] == "engine.mp4: 3/1000 frames, 0.05 frames/s, 5:32:20 left"
    assert len(lines) == 334


def test_the_note_stands_at_the_end() -> None:
    stream = io.StringIO()
    ProgressLines(1, "film", stream, Clock()).advance("147 k splats")
    assert stream.getvalue().endswith(", 147 k splats\n")


def test_steps_of_unequal_work() -> None:
    """The time remaining follows the work, the count the steps; there is no rate."""
    clock, stream = Clock(), io.StringIO()
    lines = ProgressLines([1.0, 3.0, 16.0], "measure", stream, clock, "settings")
    for seconds in (3, 9, 40):
        clock.now += seconds
        lines.advance(f"{seconds} s")
    assert stream.getvalue().splitlines() == [
        "measure: 2/3 settings, 0:48 left, 9 s",  # the first step was too small a part of the work for a line
        "measure: 3/3 settings, 40 s",
    ]


def test_work_of_nothing_has_no_time() -> None:
    clock, stream = Clock(), io.StringIO()
    lines = ProgressLines([0.0, 0.0], "measure", stream, clock, "settings")
    for _ in range(2):
        clock.now += 100
        lines.advance()
    assert stream.getvalue().splitlines() == ["measure: 1/2 settings", "measure: 2/2 settings"]


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0, "0:00"), (7.4, "0:07"), (59.6, "1:00"), (754, "12:34"), (3723, "1:02:03"), (90000, "25:00:00")],
)
def test_durations(seconds: float, text: str) -> None:
    assert format_duration(seconds) == text


def test_quiet_is_silent(capsys: pytest.CaptureFixture[str]) -> None:
    with Reporter(is_quiet=True).progress(2, label="film") as bar:
        bar.advance("a note")
        bar.advance()
    assert capsys.readouterr() == ("", "")


def test_lines_go_to_the_error_stream(capsys: pytest.CaptureFixture[str]) -> None:
    with Reporter(is_quiet=False).progress(1, label="film") as bar:
        bar.advance()
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("film: 1/1 frames, ")


def test_a_terminal_gets_a_bar(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    with Reporter(is_quiet=False).progress(2, label="film") as bar:
        bar.advance("a note")
        bar.advance()
    out, err = capsys.readouterr()
    assert out == ""
    assert "film: 100%" in err
    assert "frames/s" in err


def test_a_terminal_gets_a_bar_of_the_work(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    with Reporter(is_quiet=False).progress([1.0, 3.0], label="measure", unit="settings") as bar:
        bar.advance("tolerance 1")
        bar.advance("tolerance 0.1")
    _, err = capsys.readouterr()
    assert "measure 0/2 settings:   0%" in err
    assert "measure 1/2 settings:  25%" in err
    assert "measure 2/2 settings: 100%" in err
    assert "tolerance 0.1]" in err


def test_tqdm_is_not_imported_without_a_terminal() -> None:
    code = (
        "import sys; from hsplat_cli.terminal import Reporter\n"
        "with Reporter(is_quiet=False).progress(1, label='film') as bar: bar.advance()\n"
        "assert 'tqdm' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True, stderr=subprocess.PIPE)
