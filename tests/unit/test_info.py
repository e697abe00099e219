"""`hsplat info` describes a small volume on any terminal, as JSON, and suggests a transfer function as YAML."""

from __future__ import annotations

import json

import numpy as np
import pytest
import yaml
from click.testing import CliRunner
from transcripts import cases
from volume_files import write_image

from hsplat_cli.commands.check import check
from hsplat_cli.commands.info import describe_direction, info
from renderer.errors import InputError, SceneError

RAMP = np.arange(60).reshape(3, 4, 5)


@pytest.fixture
def ramp(tmp_path) -> str:
    np.save(tmp_path / "a.npy", RAMP.astype(np.int16))
    return str(tmp_path / "a.npy")


def run(*arguments: str, charset: str = "utf-8") -> str:
    result = CliRunner(charset=charset).invoke(info, arguments, catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return result.stdout


def facts_of(*arguments: str) -> dict:
    return json.loads(run(*arguments, "--json"))


def suggestion(output: str) -> dict:
    return yaml.safe_load(output[output.index("transfer_function:") :])["transfer_function"]


def labels_of(output: str) -> dict:
    return yaml.safe_load(output[output.index("\nlabels:") :])["labels"]


@cases("info.txt")
def test_whole_output(case, folder, capsys):
    values = np.zeros((4, 4, 4), np.uint8)
    values[1, 1] = 100
    values[2, 2, :2] = 200
    np.save("a.npy", values)
    case.check(capsys)


def test_labels_are_listed_with_their_amounts(tmp_path):
    """With the names of a table beside the file."""
    values = np.zeros((40, 40, 40), np.uint8)
    values[4:36, 4:36, 4:36], values[10:30, 10:30, 10:30] = 9, 2
    np.save(tmp_path / "a.npy", values)
    (tmp_path / "a.txt").write_text("2 a heart\n9 b \x1b[31m\n")
    volume = str(tmp_path / "a.npy")
    lines = run(volume, "--spacing", "0.5,0.5,1").splitlines()
    at = lines.index("  labels")
    assert lines[at + 1].split() == ["label", "name", "voxels", "volume", "picture"]
    assert lines[at + 2].split()[:5] == ["2", "a", "heart", "8000", "2000"]
    assert lines[at + 3].startswith(r"        9  b \x1b[31m   24768    6192  ")
    assert lines[at + 4] == ""
    facts = facts_of(volume)
    assert [tuple(label.values())[:4] for label in facts["label_table"]] == [
        (2, "a heart", 8000, 8000.0), (9, "b \x1b[31m", 24768, 24768.0),
    ]  # fmt: skip
    assert sum(label["share"] for label in facts["label_table"]) == pytest.approx(1)
    assert facts["visible"] == [] and facts["labels"]["show"] == [2, 9]


def test_the_largest_of_many_labels_are_listed(tmp_path):
    z, y, x = np.indices((40, 40, 40))
    numbers = np.where((z % 16 >= 8) | (z == 4), 1 + x // 8 + y // 8 * 5 + z // 8 * 25, 0)
    np.save(tmp_path / "a.npy", numbers.astype(np.int16))
    table = facts_of(str(tmp_path / "a.npy"))["label_table"]
    output = run(str(tmp_path / "a.npy")).split("  labels\n")[1].split("\n\n")[0].splitlines()
    assert len(output) == 42 and output[-1] == f"    and {len(table) - 40} more"
    told = [int(line.split()[1]) for line in output[1:-1]]
    assert told == sorted((label["voxels"] for label in table), reverse=True)[:40]


def test_ascii_terminal(ramp):
    assert "#" in run(ramp, charset="ascii")
    assert "█" in run(ramp, charset="utf-8")


def test_json_has_the_same_facts(ramp):
    facts = facts_of(ramp)
    assert (facts["shape"], facts["dtype"], facts["bytes"]) == ([5, 4, 3], "int16", 120)
    assert facts["world_size"] == [5.0, 4.0, 3.0]
    assert facts["world_box"] == [[-0.5, -0.5, -0.5], [4.5, 3.5, 2.5]]
    assert (facts["minimum"], facts["maximum"], facts["mean"]) == (0, 59, 29.5)
    assert facts["percentiles"]["50"] == 29.0
    assert sum(facts["histogram"]["counts"]) == 60
    assert facts["replaced_spacing"] is None
    assert facts["transfer_function"] == suggestion(run(ramp))


def test_voxels_that_stay_in_their_file_are_not_in_memory(ramp, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr("renderer.readers.voxel_limits._MIN_MAPPED_BYTES", 1)  # as if the file were large
        assert "int16, 120 bytes, which stay in the file\n" in run(ramp)
        assert facts_of(ramp)["stays_in_file"] is True
    assert "int16, 120 bytes in memory\n" in run(ramp)
    assert facts_of(ramp)["stays_in_file"] is False


def test_one_voxel_of_one_byte(tmp_path):
    np.save(tmp_path / "a.npy", np.ones((1, 1, 1), np.uint8))
    assert "uint8, 1 byte in memory\n" in run(str(tmp_path / "a.npy"))


def test_headerless_file(tmp_path):
    RAMP.astype(">i4").tofile(tmp_path / "a.raw")
    options = ("--dtype", "int32", "--byte-order", "big", "--spacing", "1,2,0.5")
    for shape in ("5,4,3", "5x4x3"):
        facts = facts_of(str(tmp_path / "a.raw"), "--shape", shape, *options)
        assert (facts["minimum"], facts["maximum"], facts["spacing"]) == (0, 59, [1.0, 2.0, 0.5])
    with pytest.raises(InputError, match="a headerless file needs both --shape and --dtype"):
        run(str(tmp_path / "a.raw"), "--shape", "5,4,3")


def test_another_spacing_than_that_of_the_file(ramp):
    output = run(ramp, "--spacing", "0.1,0.1,0.5")
    assert "  spacing      0.1 x 0.1 x 0.5, in place of 1 x 1 x 1\n  world size   0.5 x 0.4 x 1.5\n" in output
    assert "  world box    x -0.05 to 0.45, y -0.05 to 0.35, z -0.25 to 1.25\n" in output
    facts = facts_of(ramp, "--spacing", "0.1,0.1,0.5")
    assert (facts["spacing"], facts["replaced_spacing"]) == ([0.1, 0.1, 0.5], [1.0, 1.0, 1.0])


@pytest.mark.parametrize(
    ("option", "text"),
    [
        ("--spacing", "1e-31,1,1"),
        ("--spacing", "1,1,1e31"),
        *(("--shape", text) for text in ("5,4", "5,4,x", "5,4,0", "5,4,-1")),
    ],
)
def test_wrong_numbers_are_errors_of_their_option(option, text):
    with pytest.raises(InputError, match=rf"^{option} {text}: "):
        run("a.raw", "--dtype", "uint8", option, text)


@pytest.mark.parametrize(
    ("option", "text", "hint"),
    [
        ("--dtype", "uchar", "did you mean uint8?"), ("--dtype", "UINT8", "did you mean uint8?"),
        ("--dtype", "int12", "did you mean int16?"), ("--dtype", ">u2", "did you mean uint16 with byte order big?"),
        ("--dtype", "<f4", "did you mean float32?"), ("--dtype", "", None),
        ("--byte-order", "bigg", "did you mean big?"), ("--offset", "-1", None), ("--time", "one", None),
        ("--component", "1.5", None),
    ],
)  # fmt: skip
def test_options_are_read_as_the_keys_of_a_scene(option, text, hint):
    with pytest.raises(SceneError) as caught:
        run("a.raw", "--shape", "5,4,3", option, text)
    (problem,) = caught.value.problems
    assert (problem.location, problem.hint) == (f"{option} {text}", hint)


def test_a_folder_of_volumes_is_listed(tmp_path):
    (tmp_path / "a" / "b").mkdir(parents=True)
    np.save(tmp_path / "a" / "one.npy", RAMP.astype(np.int16))
    write_image(tmp_path / "a" / "b" / "two.nrrd", RAMP.astype(np.uint8))
    (tmp_path / "a" / "b" / "bad.nrrd").write_bytes(b"NRRD0004\n")
    (tmp_path / "a" / "b" / "loop").symlink_to(tmp_path)
    (tmp_path / "again.npy").symlink_to(tmp_path / "a" / "one.npy")
    again, bad, two = json.loads(run(str(tmp_path), "--json"))
    assert again == {"volume": f"{tmp_path}/again.npy", "format": "npy", "type": "int16", "shape": "5 x 4 x 3"}
    assert two == {"volume": f"{tmp_path}/a/b/two.nrrd", "format": "nrrd", "type": "uint8", "shape": "5 x 4 x 3"}
    assert bad["type"] == "-" and bad["shape"].startswith(f"{tmp_path}/a/b/bad.nrrd: ")
    names = [f"{tmp_path}/{name}" for name in ("again.npy", "a/b/bad.nrrd", "a/b/two.nrrd")]
    assert [line.split()[0] for line in run(str(tmp_path)).splitlines()] == ["volume", *names]


def test_masks_of_a_scene_are_listed(tmp_path):
    np.save(tmp_path / "scan.npy", RAMP.astype(np.int16))
    np.save(tmp_path / "parts.npy", (RAMP > 30).astype(np.uint8))
    layers = [
        {"file": "scan.npy", "name": "a", "color": "red", "range": [0, 9], "mask": {"file": "parts.npy"}},
        {"file": "parts.npy", "labels": {"show": [1]}},
    ]
    tree = {"volumes": layers, "camera": {"path": {"type": "turntable", "frames": 2}}, "output": {"file": "a.mp4"}}
    (tmp_path / "scene.yaml").write_text(yaml.safe_dump({"version": 1, **tree}))
    rows = json.loads(run(str(tmp_path / "scene.yaml"), "--json"))
    assert [(row["volume"], row["type"]) for row in rows] == [
        ("a", "int16"), ("a.mask", "uint8"), ("volumes.1", "uint8"),
    ]  # fmt: skip
    told = CliRunner().invoke(check, [str(tmp_path / "scene.yaml")]).stdout
    assert f"  mask     a: {tmp_path}/parts.npy\n  volume   {tmp_path}/parts.npy, weight 1\n" in told
    (tmp_path / "parts.npy").write_bytes(b"no volume")
    assert "parts.npy: this is not a volume" in str(CliRunner().invoke(check, [str(tmp_path / "scene.yaml")]).exception)


def test_time_component_and_nodata(tmp_path):
    steps = np.stack([RAMP, RAMP + 100.0])
    steps[0, 0, 0, 0] = np.nan
    np.save(tmp_path / "a.npy", steps)
    file = str(tmp_path / "a.npy")
    assert facts_of(file, "--time", "1")["minimum"] == 100.0
    with pytest.raises(InputError, match="1 of 60 voxels are NaN or infinite"):
        run(file, "--time", "0", "--nodata", "none")
    facts = facts_of(file, "--time", "0")
    assert (facts["minimum"], facts["without_data"]) == (1.0, 1)
    assert facts_of(file, "--time", "0", "--nodata", "1,3")["minimum"] == 2.0


def test_the_described_component_is_told_and_how_all_are_drawn(tmp_path):
    np.save(tmp_path / "two.npy", np.random.default_rng(0).random((8, 8, 8, 2)))
    lines = run(str(tmp_path / "two.npy"), "--component", "1").splitlines()
    told = "values here are of component 1; `hsplat init VOLUME --component all` draws all together"
    assert f"{'':15}{told}" in lines


def test_the_first_of_several_times_is_drawn_and_said(tmp_path):
    write_image(tmp_path / "a.nrrd", np.stack([RAMP, RAMP + 100.0]))
    result = CliRunner().invoke(info, [str(tmp_path / "a.nrrd"), "--json"])
    assert result.exit_code == 0
    assert "a.nrrd: 2 times; the first is drawn; `--time k` chooses another" in result.stderr
    assert json.loads(result.stdout)["minimum"] == RAMP.min()
    assert "times" not in CliRunner().invoke(info, [str(tmp_path / "a.nrrd"), "--time", "1"]).stderr


TURN = np.array([[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])


@pytest.mark.parametrize(
    ("axes", "words"),
    [
        (np.diag([1.0, 2.0, 3.0]), "axis-aligned"),
        (np.diag([1.0, -2.0, -3.0]), "axis-aligned, y z flipped"),
        (np.diag([1.0, 2.0, -3.0]), "axis-aligned, z flipped, mirrored"),
        (
            np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
            "axis-aligned, x y z of the voxels lie along y z x of the world",
        ),
        (TURN * [1.0, 2.0, 3.0], "oblique"),
        (TURN * [1.0, 2.0, -3.0], "oblique, mirrored"),
        (np.array([[1.0, 0.1, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]), "sheared"),
    ],
)
def test_the_direction_is_described(axes, words):
    assert describe_direction(axes) == words


def test_a_sample_of_a_large_volume_is_told(tmp_path, monkeypatch):
    monkeypatch.setattr("renderer.statistics.histogram._CHUNK", 1000)
    monkeypatch.setattr("renderer.statistics.histogram.MOST_COUNTED", 7000)
    np.save(tmp_path / "a.npy", np.random.default_rng(2).random((30, 30, 30), np.float32))
    text, facts = run(str(tmp_path / "a.npy")), facts_of(str(tmp_path / "a.npy"))
    assert "  sample       mean, percentiles and histogram are of 7000 of 27000 voxels; the range is of all" in text
    assert facts["sampled_voxels"] == 7000 and facts["reason"].endswith("; counted on 7000 of 27000 voxels")
    assert facts_of(str(tmp_path / "a.npy"))["percentiles"] == facts["percentiles"]
