"""Commands take the URL of a store wherever they take the file of a volume."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import yaml
from store_files import scaled, write_ome
from store_server import ServedFolder, served_folder

from hsplat_cli import main

pytestmark = pytest.mark.usefixtures("folder")

# A ball whose values fall off from the middle.
VALUES = np.clip(200 * (1 - np.linalg.norm(np.indices((20, 20, 20)) / 10 - 0.95, axis=0)), 0, 255).astype(np.uint8)
SMALL = ("--frames", "2", "--size", "32", "--quiet")


@pytest.fixture
def server(tmp_path: Path) -> Iterator[ServedFolder]:
    for name in ("a/scan.ome.zarr", "b/scan.ome.zarr"):
        write_ome(tmp_path / "served" / name, [VALUES], [scaled(1, 1, 1)], chunks=VALUES.shape)
    with served_folder(tmp_path / "served") as served:
        yield served


@pytest.mark.slow
def test_turntables_of_urls(server: ServedFolder, capsys: pytest.CaptureFixture[str]) -> None:
    """Stores of one name get their folders; the films of a second job are up to date."""
    np.save("local.npy", VALUES)
    urls = [f"{server.url}/{name}/scan.ome.zarr" for name in "ab"]
    command = ["turntable", "-o", "films", *SMALL, *urls, "local.npy", urls[0]]
    assert main.run(command) == 0
    names = ["a_scan", "b_scan"]
    for name, url in zip(names, urls, strict=True):
        assert yaml.safe_load(Path(f"films/{name}.yaml").read_text("utf-8"))["volume"]["file"] == url
    listed = {each["volume"] for each in json.loads(Path("films/turntable.json").read_text("utf-8"))["films"]}
    assert listed == {*urls, "../local.npy"}
    states = [os.stat(f"films/{name}.mp4") for name in names]
    capsys.readouterr()
    assert main.run(command) == 0
    assert [os.stat(f"films/{name}.mp4") for name in names] == states
    assert urls[1] in capsys.readouterr().out


@pytest.mark.slow
def test_a_film_of_another_url_keeps_its_scene(server: ServedFolder, capsys: pytest.CaptureFixture[str]) -> None:
    url, other = (f"{server.url}/{name}/scan.ome.zarr" for name in "ab")
    assert main.run(["turntable", "-o", "films", *SMALL, url]) == 0
    assert main.run(["turntable", "-o", "films", *SMALL, other]) == 2
    assert f"got: the scene of {url}" in capsys.readouterr().err


@pytest.mark.slow
def test_other_commands_with_urls(server: ServedFolder, capsys: pytest.CaptureFixture[str]) -> None:
    """A page, a film over a store and one of another place, and a film that is verified."""
    url, other = (f"{server.url}/{name}/scan.ome.zarr" for name in "ab")
    assert main.run(["preview", url, "-o", "page.html", "--quiet"]) == 0
    assert "Preview of scan.ome.zarr" in Path("page.html").read_text("utf-8")
    np.save("local.npy", VALUES)
    assert main.run(["turntable", "-o", "over", *SMALL, "local.npy", "--over", url]) == 0
    layers = yaml.safe_load(Path("over/local.yaml").read_text("utf-8"))["volumes"]
    assert [each["file"] for each in layers] == ["../local.npy", url]
    assert main.run(["turntable", "-o", "films", *SMALL, url]) == 0
    for place in ([], ["--volume", other]):
        capsys.readouterr()
        assert main.run(["verify", "films/scan.mp4", "--precision", "5", *place]) == 0
        assert "of this volume" in capsys.readouterr().out
    assert main.run(["preview", "films/scan.yaml", "--volume", other, "-o", "other.html", "--quiet"]) == 0
    assert main.run(["verify", "films/scan.mp4", "--volume", f"{server.url}/nothing"]) == 2
    assert f"{server.url}/nothing" in capsys.readouterr().err


@pytest.mark.slow
def test_a_look_that_matches_a_url(server: ServedFolder) -> None:
    url, other = (f"{server.url}/{name}/scan.ome.zarr" for name in "ab")
    assert main.run(["turntable", "-o", "first", *SMALL, url]) == 0
    look = ("--scene", "first/scan.yaml", "--match", url)
    assert main.run(["turntable", "-o", "films", *look, other, "--quiet"]) == 0
    assert yaml.safe_load(Path("films/scan.yaml").read_text("utf-8"))["volume"]["file"] == other
