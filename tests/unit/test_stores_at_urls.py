"""Stores at URLs, in the child process that reads all stores: over HTTP with faults, and as scenes name them."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from store_files import field, halves, scaled, sharded, write_json, write_n5, write_ome, write_precomputed, zipped_store
from store_server import STALL, ServedFolder, served_folder
from volume_files import read

from hsplat_cli.commands.info import info
from renderer.errors import InputError, SceneError
from renderer.readers import read_volume
from renderer.scene import UrlSource, VolumeSpec, parse_scene, scene_to_dict, with_files
from renderer.volume import Volume

FIELD = field()
LEVELS = [FIELD, halves(FIELD, 1, 2, 2)]
PLACES = [scaled(2.0, 0.5, 0.5, translation=(1.0, 2.0, 3.0)), scaled(2.0, 1.0, 1.0, translation=(1.0, 2.25, 3.25))]


@pytest.fixture
def server(tmp_path: Path) -> Iterator[ServedFolder]:
    write_ome(tmp_path / "a.ome.zarr", LEVELS, PLACES)
    with served_folder(tmp_path) as served:
        yield served


def _read(url: str, **choice: Any) -> Volume:
    return read_volume(VolumeSpec(UrlSource(url), **choice))


def test_a_local_store_is_read_in_a_child_process(tmp_path: Path) -> None:
    folder = write_ome(tmp_path / "a", LEVELS, PLACES)
    volume = read(folder, crop=((3, 9), None, None), level=1, spacing=(1.0, 1.0, 2.0))
    np.testing.assert_array_equal(volume.values, LEVELS[1][:, :, 1:5])
    assert volume.spacing.tolist() == [2, 2, 2] and volume.file_spacing == (0.5, 0.5, 2.0)
    assert volume.world_from_index[:3, 3].tolist() == [3 + 0.5 + 2, 2 + 0.5, 1]
    assert [each.is_read for each in volume.levels] == [False, True]


def test_only_the_chunks_of_a_crop_are_asked_for(server: ServedFolder) -> None:
    volume = _read(f"{server.url}/a.ome.zarr", level=0, crop=((5, 10), (6, 9), (7, 8)))
    np.testing.assert_array_equal(volume.values, FIELD[7:8, 6:9, 5:10])
    assert volume.world_from_index[:3, 3].tolist() == [3 + 2.5, 2 + 3, 1 + 14]
    assert [path for path in server.asked if path[-1].isdigit()] == ["/a.ome.zarr/0/1.1.1"]


@pytest.mark.usefixtures("one_process")
def test_formats_over_http(tmp_path: Path, server: ServedFolder) -> None:
    zipped_store(tmp_path / "a.ome.zarr", tmp_path / "a.ozx")
    write_n5(tmp_path / "a.n5", LEVELS, [{"downsamplingFactors": [1, 1, 1]}, {"downsamplingFactors": [2, 2, 1]}])
    write_precomputed(tmp_path / "p", LEVELS, [{}, {"resolution": [8, 8, 40]}])
    write_ome(tmp_path / "b", LEVELS, PLACES, version="0.5")
    for name in ("a.ome.zarr", "a.ozx", "a.n5", "p", "b", "b/"):
        np.testing.assert_array_equal(_read(f"{server.url}/{name}", level=1).values, LEVELS[1])


@pytest.mark.usefixtures("one_process")
def test_no_part_of_a_shard_is_asked_for_twice(
    tmp_path: Path, server: ServedFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nor is the index of a shard, though each slab needs it."""
    write_ome(tmp_path / "b", [FIELD], PLACES[:1], version="0.5", chunks=[6, 7, 6], codecs=sharded(1, 7, 3))
    monkeypatch.setattr("renderer.stores.levels._SLAB_BYTES", 1)
    np.testing.assert_array_equal(_read(f"{server.url}/b").values, FIELD)
    asked = [(path, part) for path, part in server.parts if "/c/" in path]
    assert len(asked) == len({*asked}) > 12
    assert len([part for _, part in asked if part.startswith("bytes=-")]) == 12


def test_a_failed_request_is_repeated(server: ServedFolder) -> None:
    server.faults = {"0/1.1.1": [503, None], ".zattrs": [503]}
    np.testing.assert_array_equal(_read(f"{server.url}/a.ome.zarr", level=0).values, FIELD)
    assert server.asked.count("/a.ome.zarr/0/1.1.1") == 3


# Reads a chunk of a store with short limits. A process of its own, as tensorstore takes limits once for a process.
_READ_SOON = """
import sys
import numpy as np
import pytest
from renderer.errors import InputError
from renderer.stores import open_store
url, stalled, whole = sys.argv[1:]
limits = pytest.MonkeyPatch()
limits.setenv("TENSORSTORE_CURL_LOW_SPEED_TIME_SECONDS", stalled)
retries = {"max_retries": 1, "initial_delay": "10ms", "max_delay": "10ms"}
limits.setattr("renderer.stores.library._RETRIES", retries)
for file in ("library", "store", "store_files"):
    limits.setattr(f"renderer.stores.{file}.REQUEST_SECONDS", float(whole))
try:
    voxels = np.zeros((2, 2, 2), "uint16")
    open_store(url).read_box(0, [slice(5, 7)] * 3, voxels)
    print(voxels.sum())
except InputError as error:
    print(error)
"""


# The files of a store that a server stalls at: a chunk, the metadata of an array, those of the store.
_STALLED = ("0/1.1.1", "0/.zarray", ".zattrs")


def _read_soon(
    folder: Path, num_stalls: int, *, stalled: int = 1, whole: float = 60
) -> list[tuple[str, ServedFolder, str]]:
    """Return what the reading of a chunk prints where the server stalls: the sum of voxels, or an error.

    All of _STALLED wait at the same time, each with a server of its own. The result has the name of the file, its
    server, and the printed text. num_stalls: how many requests for the file are not answered. stalled, whole: limits in
    seconds, without and with retries.
    """
    write_ome(folder / "a.ome.zarr", LEVELS, PLACES)
    with ExitStack() as stack:
        servers = [stack.enter_context(served_folder(folder)) for _ in _STALLED]
        readers = []
        for name, server in zip(_STALLED, servers, strict=True):
            server.faults = {name: [STALL] * num_stalls}
            command = [sys.executable, "-c", _READ_SOON, f"{server.url}/a.ome.zarr", str(stalled), str(whole)]
            readers.append(subprocess.Popen(command, stdout=subprocess.PIPE, text=True))
        shown = [reader.communicate(timeout=120)[0] for reader in readers]
    assert [reader.returncode for reader in readers] == [0] * len(_STALLED)
    return [*zip(_STALLED, servers, shown, strict=True)]


@pytest.mark.slow
def test_a_server_that_stalls_is_asked_again(tmp_path: Path) -> None:
    for name, server, shown in _read_soon(tmp_path, 1):
        assert shown == f"{FIELD[5:7, 5:7, 5:7].sum()}\n"
        assert server.asked.count(f"/a.ome.zarr/{name}") == 2


@pytest.mark.slow
def test_a_server_that_stalls_for_good_is_an_error(tmp_path: Path) -> None:
    for name, server, shown in _read_soon(tmp_path, 9):
        assert shown.startswith(f"{server.url}/a.ome.zarr") and "retry attempts failed" in shown
        assert "hint: the server or the network failed, also after retries: run the command again" in shown
        assert server.asked.count(f"/a.ome.zarr/{name}") == 2


@pytest.mark.slow
def test_no_request_takes_longer_than_its_limit(tmp_path: Path) -> None:
    """Also where the limit of a server that stalls does not hold, as of one that sends a byte now and then."""
    for _, server, shown in _read_soon(tmp_path, 9, stalled=600, whole=1):
        assert shown.startswith(f"{server.url}/a.ome.zarr") and "got: no answer in time" in shown


@pytest.mark.parametrize(
    ("name", "code", "hint"),
    [
        ("0/1.1.1", 403, "the server refuses access"),
        (".zattrs", 403, "the server refuses access"),
        ("0/.zarray", 404, "a part of the store is missing"),
    ],
)
def test_requests_that_fail_are_errors(server: ServedFolder, name: str, code: int, hint: str) -> None:
    server.faults = {name: [code] * 99}
    with pytest.raises(InputError) as error:
        _read(f"{server.url}/a.ome.zarr", level=0)
    assert hint in str(error.value.hint) and server.url in str(error.value)


@pytest.fixture
def buckets(tmp_path: Path, server: ServedFolder, monkeypatch: pytest.MonkeyPatch) -> ServedFolder:
    """Serve the folder `bucket` as a bucket of S3 and of Google, without credentials of this machine."""
    write_ome(tmp_path / "bucket/a.ome.zarr", LEVELS, PLACES)
    for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY", "AWS_PROFILE", "GOOGLE_APPLICATION_CREDENTIALS"):
        monkeypatch.delenv(name, raising=False)
    for name in ("AWS_CONFIG_FILE", "AWS_SHARED_CREDENTIALS_FILE"):
        monkeypatch.setenv(name, "/dev/null")
    monkeypatch.setenv("AWS_EC2_METADATA_DISABLED", "true")
    monkeypatch.setenv("AWS_ENDPOINT_URL", server.url)
    monkeypatch.setenv("TENSORSTORE_GCS_HTTP_URL", server.url)
    return server


@pytest.mark.parametrize("scheme", ["s3", "gs"])
@pytest.mark.usefixtures("buckets")
def test_buckets_are_read_without_credentials(scheme: str) -> None:
    volume = _read(f"{scheme}://bucket/a.ome.zarr", level=1)
    np.testing.assert_array_equal(volume.values, LEVELS[1])
    with pytest.raises(InputError, match="there is no store here"):
        _read(f"{scheme}://bucket/nothing")


def test_credentials_of_s3(buckets: ServedFolder, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the right key, the error says so; the key is in no message."""
    buckets.key = "right"
    for key in ("", "wrong", "right"):
        monkeypatch.setenv("AWS_ACCESS_KEY_ID", key)
        monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "secret")
        if key == "right":
            np.testing.assert_array_equal(_read("s3://bucket/a.ome.zarr", level=1).values, LEVELS[1])
            break
        with pytest.raises(InputError, match="the metadata of this store cannot be read") as error:
            _read("s3://bucket/a.ome.zarr")
        assert error.value.where == "s3://bucket/a.ome.zarr" and "the server refuses access" in str(error.value.hint)
        assert "secret" not in str(error.value)


def test_missing_files_may_be_refused(buckets: ServedFolder) -> None:
    """S3 answers so where nobody may list the bucket."""
    buckets.faults = {f"a.ome.zarr/{name}": [403] * 9 for name in ("zarr.json", ".zarray")}
    np.testing.assert_array_equal(_read("s3://bucket/a.ome.zarr", level=1).values, LEVELS[1])


def test_a_missing_chunk_at_a_url_has_the_fill_value(server: ServedFolder) -> None:
    server.faults = {"0/1.1.1": [404]}
    volume = _read(f"{server.url}/a.ome.zarr", level=0)
    assert not volume.values[5:10, 5:10, 5:10].any() and volume.values[0, 0, 1] == FIELD[0, 0, 1]


def test_no_store_at_a_url(server: ServedFolder) -> None:
    with pytest.raises(InputError, match="there is no store here") as error:
        _read(f"{server.url}/nothing")
    assert error.value.where == f"{server.url}/nothing"


def test_a_url_stays_a_url(tmp_path: Path) -> None:
    url = "https://example.org/a//b.zarr/"
    tree: dict[str, Any] = {
        "volume": {"file": url, "level": 2},
        "transfer_function": {"points": [{"value": 0, "color": "red", "opacity": 0.5}]},
        "camera": {"path": {"type": "turntable", "frames": 2}},
        "output": {"file": "a.mp4"},
    }
    scene = parse_scene(tree, base=tmp_path)
    assert scene.at(0).layers[0].volume.source == UrlSource(url)
    plain = scene_to_dict(scene)
    assert with_files(plain, lambda _, name: f"moved/{name}")["volume"]["file"] == url
    tree["volume"] = {"file": "https://me:secret@example.org/a.zarr"}
    with pytest.raises(SceneError, match="a URL with a name or a password") as error:
        parse_scene(tree, base=tmp_path)
    assert "secret" not in str(error.value)


def test_info_lists_the_levels(server: ServedFolder) -> None:
    shown = CliRunner().invoke(info, [f"{server.url}/a.ome.zarr", "--level", "1"])
    assert shown.exit_code == 0
    assert (
        "  levels       0: 18 x 14 x 12 voxels in chunks of 5 x 5 x 5, 6048 bytes\n"
        "               1: 9 x 7 x 12 voxels in chunks of 5 x 5 x 5, 1512 bytes, which is read\n"
    ) in shown.output
    assert "  stored " not in shown.output


def test_info_adds_the_sizes_of_files(tmp_path: Path) -> None:
    folder = write_ome(tmp_path / "a.ome.zarr", LEVELS, PLACES)
    size = sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())
    shown = CliRunner().invoke(info, [str(folder)]).output
    assert f"  stored       {size} bytes\n" in shown


@pytest.mark.parametrize("has_absent", [False, True])
def test_info_says_where_voxels_of_a_store_are(tmp_path: Path, *, has_absent: bool) -> None:
    """They are decoded into a file on disk, unless voxels without data are marked in a copy of them."""
    values = np.ones((2, 3, 4), np.float32)
    values[0] = np.nan if has_absent else 0.0
    folder = write_ome(tmp_path / "a", [values], PLACES[:1])
    place = " in memory" if has_absent else ", decoded into a file on disk"
    assert f"  type         float32, 96 bytes{place}\n" in CliRunner().invoke(info, [str(folder)]).stdout
    told = json.loads(CliRunner().invoke(info, [str(folder), "--json"]).stdout)
    assert (told["decoded_on_disk"], told["stays_in_file"]) == (not has_absent, False)


def test_metadata_of_a_local_store_reach_no_server(tmp_path: Path, server: ServedFolder) -> None:
    fields = {"multiscales": [{"axes": list("zyx"), "datasets": [{"path": f"{server.url}/a.ome.zarr/0"}]}]}
    write_json(tmp_path / "b/.zattrs", fields)
    write_json(tmp_path / "b/.zgroup", {"zarr_format": 2})
    with pytest.raises(InputError, match="a place outside of it"):
        read(tmp_path / "b")
    assert server.asked == []
