"""What a film costs is predicted from few of its frames: by `check` before it is made, or while a long one is."""

from __future__ import annotations

from pathlib import Path

import pytest
from small_scene import engine_block, small_tree

from hsplat_cli.terminal import FilmEvents, Reporter
from renderer import job as jobs
from renderer.job import choose_trials
from renderer.scene import accuracy_of, parse_scene

CROPS = [[[0, 24], [0, 24], [first, 12]] for first in (0, 6)]
FILES = [{"file": "a.mp4", "size": [64, 64]}, {"file": "b.gif", "every": 6}, {"file": "c-{frame}.png"}]
STILL = {"file": "still.png", "frame": 9, "background": "transparent"}


class Told(FilmEvents):
    forecast: jobs.Forecast | None = None

    def predicted(self, forecast: jobs.Forecast) -> None:
        super().predicted(forecast)
        self.forecast = forecast


def test_the_sizes_of_a_film(folder: Path, monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    scene = parse_scene(small_tree(frames=36, output=[*FILES, STILL]), base=Path())
    job = jobs.FilmJob(scene, range(36), accuracy_of(scene.error))
    before = jobs.forecast_film(job, jobs.open_local_executor, jobs.JobEvents())
    assert before.seconds > 0 and not [*folder.iterdir()]
    monkeypatch.setattr("renderer.job.film_making._LONG_S", 0.0)
    with Told(Reporter(), "brick") as told:
        jobs.make_film(job, jobs.open_local_executor, jobs.one_pass, told)
    assert "a.mp4: about " in capsys.readouterr().err
    for each in scene.output.files:
        size = sum(file.stat().st_size for file in folder.glob(each.file.name.replace("{frame}", "*")))
        assert before.num_bytes[each.file] == pytest.approx(size, rel=0.15)
        if each.frame is None:  # the first frames alone were known
            assert told.forecast is not None and told.forecast.num_bytes[each.file] == pytest.approx(size, rel=0.3)


def test_trials_stand_for_all_frames() -> None:
    still, moving = small_tree(frames=60), {"volume": engine_block(24, 24, 12) | {"crop": {20: CROPS[0], 50: CROPS[1]}}}
    assert [*choose_trials(parse_scene(still, base=Path()), range(5))] == [([0, 1], 2), ([2, 3, 4], 3)]
    trials = choose_trials(parse_scene(still | moving, base=Path()), range(60))
    assert trials == [([27, 28, 29], 15), ([42, 43, 44], 15), ([6, 7, 8], 15), ([51, 52, 53], 15)]
    for seconds, num_bytes, text in [(2.06, 3499, "2.1 s, 3.5 kB"), (723, 2.5e8, "12 min, 250 MB")]:
        forecast = jobs.Forecast(seconds, {Path("film.mp4"): num_bytes})
        assert f"{forecast.seconds_text}, {forecast.bytes_text(forecast.num_bytes)}" == text
