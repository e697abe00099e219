"""The exposure that `light.exposure: auto` chooses is printed and recorded, and as a number draws the same bytes."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from small_scene import edit_sidecar, sidecar, small_scene

from hsplat_cli import main

pytestmark = pytest.mark.usefixtures("scene_folder")

SCENE = small_scene(frames=3, error="tolerance: 0.5, probes: 16")
SCENE += "light: {key: {direction: [1, -1, 1], strength: 2.5}, surface: 0.5}\n"
SENTENCE = r"exposure:? (\S+) stops \(auto\); --set light\.exposure=(\S+) keeps it in another light"


def render(*arguments: str) -> None:
    assert main.run(["render", *arguments]) == 0


def test_the_chosen_number_draws_the_same_bytes(capsys: pytest.CaptureFixture[str]) -> None:
    render("scene.yaml", "--output", "auto.webp")
    (found,) = re.findall(SENTENCE, capsys.readouterr().err)
    told = sidecar("auto.webp.json")
    assert [*map(float, found)] == [told["exposure"]] * 2 and told["exposure"] != 0
    assert told["scene"]["light"]["exposure"] == "auto"
    render("scene.yaml", "--set", f"light.exposure={found[1]}", "--output", "given.webp")
    assert "exposure:" not in capsys.readouterr().err and "exposure" not in sidecar("given.webp.json")
    assert Path("given.webp").read_bytes() == Path("auto.webp").read_bytes()
    assert main.run(["check", "scene.yaml"]) == 0
    assert re.findall(SENTENCE, capsys.readouterr().out) == [found]


def test_a_stronger_lamp_gets_a_smaller_exposure() -> None:
    """The number keeps the exposure in another light; with `auto`, the film is about as bright as before."""
    render("scene.yaml", "--output", "one.webp", "--quiet")
    render("scene.yaml", "--set", "light.key.strength=10", "--output", "ten.webp", "--quiet")
    assert sidecar("ten.webp.json")["exposure"] < sidecar("one.webp.json")["exposure"] - 1


def test_a_film_is_made_again_with_or_without_the_number_in_its_record() -> None:
    """Records of films that were made before the number was recorded lack it."""
    render("scene.yaml", "--output", "film.webp", "--quiet")
    made = Path("film.webp").read_bytes()
    for keep in (True, False):
        if not keep:
            edit_sidecar("film.webp.json", lambda data: data.pop("exposure"))
        Path("film.webp").unlink()
        render("film.webp.json", "--quiet")
        assert Path("film.webp").read_bytes() == made and "exposure" in sidecar("film.webp.json")


def test_parts_keep_it() -> None:
    for frames in ("0:2", "2:3"):
        render("scene.yaml", "--frames", frames, "--output", "parts/{frame}.png", "--quiet")
    assert main.run(["assemble", "parts", "--output", "film.webp", "--quiet"]) == 0
    parts = [sidecar(str(path))["exposure"] for path in Path("parts").glob("*.json")]
    assert len(parts) == 2 and [*parts, sidecar("film.webp.json")["exposure"]] == [parts[0]] * 3
