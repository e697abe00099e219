"""Words, presets and files of other programs steer a suggestion."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from kinds_of_data import KINDS, dark_object, extinction, head_as_unsigned, two_materials, volume_of

from renderer.errors import InputError
from renderer.statistics import compute_statistics, sample_volume
from renderer.suggest import PRESET_WORDS, WISHES, Materials, Suggestion, Wish, suggest

CLUT = """[FLT]
min=0
max=200
[INT]
numnodes=2
[BYT]
nodeintensity0=0
nodeintensity1=255
[RGBA255]
nodergba0=0|0|0|0
nodergba1=255|128|0|102
"""


def wished(values: np.ndarray, preset: str, **options: str) -> Suggestion:
    volume = volume_of(values)
    return suggest(volume, compute_statistics(volume.values), Wish(preset=preset, **options))


def test_help_names_all_words() -> None:
    assert (*WISHES, "labels") == PRESET_WORDS


@pytest.mark.slow
@pytest.mark.parametrize("word", WISHES)
@pytest.mark.parametrize("name", ["head as uint16", "magnetic resonance", "uint8", "dark object", "signed", "phases"])
def test_every_word_shows_something_of_every_volume(word: str, name: str) -> None:
    values, _ = KINDS[name]
    depths = extinction(wished(values, word).transfer, *np.unique(values).tolist())
    assert max(depths) > 0


@pytest.mark.parametrize(("word", "shown", "hidden"), [("bone", 1100, 40), ("skin", 40, -900), ("surface", 40, -900)])
def test_words_are_ranges_of_hounsfield_units(word: str, shown: float, hidden: float) -> None:
    """The head is stored with 1024 added."""
    found = wished(head_as_unsigned(), word)
    inside, outside = extinction(found.transfer, shown + 1024, hidden + 1024)
    assert inside > 0 == outside
    assert "1024 added" in found.reason


def test_a_word_shows_the_same_of_a_dark_object() -> None:
    bright, dark = (
        extinction(wished(two_materials("uint8"), "bone").transfer, 220, 95, 12),
        extinction(wished(dark_object(), "bone").transfer, 35, 160, 243),
    )
    np.testing.assert_allclose(bright, dark, rtol=0.05)
    assert bright[0] > 0 == bright[1] == bright[2]


def test_labels_can_be_wished_for() -> None:
    """Of values that would be taken for a scan."""
    values = two_materials("uint8")
    labels = wished(values, "labels").transfer.labels
    assert labels is not None and len(labels.values) == len(np.unique(values)) - 1
    with pytest.raises(InputError, match="too many values for labels"):
        wished(np.arange(48**3).reshape(48, 48, 48), "labels")
    with pytest.raises(InputError, match="no map of labels"):
        wished(KINDS["signed"][0], "labels")


def test_a_preset_for_hounsfield_units_is_shifted() -> None:
    found = wished(head_as_unsigned(), "ct-bone")
    clear, bone = extinction(found.transfer, 1024 + 40, 1024 + 1100)
    assert clear == 0 < bone
    assert "1024 added" in found.reason and found.shading is not None and found.shading.light == "camera"


def test_a_preset_for_hounsfield_units_on_other_values_is_told_with_what_fits_it() -> None:
    """Those of the object, here from 10 to 226, become the range from 180 to 1900 in which the preset changes."""
    (note,) = wished(two_materials("uint8"), "ct-bone").outlier_notes
    found = re.search(r"here lie from (\S+) to (\S+); .*shift: (\S+)` .*`scale: (\S+)`", note)
    assert found is not None and "made for values from 180 to 1900" in note
    low, high, shift, scale = map(float, found.groups())
    assert (low, high) == pytest.approx((10, 226), abs=1)
    assert (180 * scale + shift, 1900 * scale + shift) == pytest.approx((low, high), rel=1e-2, abs=0.1)
    assert not wished(head_as_unsigned(), "ct-bone").outlier_notes
    assert not wished(two_materials("uint8"), "mr-angio").outlier_notes


def test_a_preset_of_shares_is_stretched_over_the_object() -> None:
    low, high = extinction(wished(two_materials("uint8"), "mr-angio").transfer, 60, 225)
    assert low == 0 < high


def test_a_file_of_another_program(tmp_path: Path) -> None:
    file = tmp_path / "warm.clut"
    file.write_text(CLUT)
    found = wished(two_materials("uint8"), str(file), colormap="viridis")
    (depth,) = extinction(found.transfer, 200)
    assert -np.expm1(-depth) == pytest.approx(0.4, abs=1e-3)


@pytest.mark.parametrize(
    ("preset", "message"),
    [
        ("ct-bones", "no transfer function of this name"),
        ("bnoe", "did you mean bone"),
        ("missing.xml", "no such file"),
        ("presets.xml", "has several transfer functions"),
        ("presets.xml#B", "no transfer function of this name"),
    ],
)
def test_what_cannot_be_read_is_told_with_the_option(tmp_path, monkeypatch, preset: str, message: str) -> None:
    monkeypatch.chdir(tmp_path)
    one = '<VolumeProperty name="{}" scalarOpacity="4 0 0 9 1" colorTransfer="8 0 0 0 0 9 1 1 1"/>'
    Path("presets.xml").write_text(f"<a>{one.format('Air')}{one.format('Bone')}</a>")
    with pytest.raises(InputError, match=message) as caught:
        wished(two_materials("uint8"), preset)
    assert f"preset {preset}" in str(caught.value)


def test_what_is_not_imported_is_told_beside_outliers(tmp_path: Path) -> None:
    values = two_materials("uint8").astype(np.float32)
    values[20, 20, 20] = -9999
    file = tmp_path / "presets.xml"
    file.write_text(
        '<a><VolumeProperty name="A" scalarOpacity="4 30 0 200 1" gradientOpacity="4 0 0 9 1"'
        ' colorTransfer="8 0 0 0 0 200 1 1 1"/></a>'
    )
    outlier, left_out = wished(values, str(file)).outlier_notes
    assert "-9999, far from all neighbours" in outlier and left_out.startswith("not imported: ")


def test_the_object_has_no_upper_end_where_a_brain_is_wished_for() -> None:
    values = np.zeros((20, 20, 20))
    values[3, 4, 5] = 1
    assert extinction(wished(values, "brain").transfer, 0, 1)[1] > 0


def fading(peak: float) -> np.ndarray:
    """Return a ball, dense in the middle and thin at its surface, in air at 0."""
    z, y, x = np.meshgrid(*[np.linspace(-1, 1, 48)] * 3, indexing="ij")
    return np.rint(peak * np.clip(1 - np.sqrt(x**2 + y**2 + z**2) / 0.8, 0, 1) ** 3)


@pytest.mark.parametrize("preset", [*WISHES, "ct-bone", "ct-soft-tissue", "ct-skin", "ct-lung", "mr-head", "xray"])
@pytest.mark.parametrize("peak", [40, 255, 3000])
def test_no_preset_shows_the_air(preset: str, peak: float) -> None:
    """Whatever the values, those of the air around an object are transparent."""
    found = wished(fading(peak).astype(np.uint16), preset)
    (air,) = extinction(found.transfer, 0)
    assert air == 0


def test_a_file_that_shows_the_background_is_told(tmp_path: Path) -> None:
    file = tmp_path / "fog.clut"
    file.write_text(CLUT.replace("0|0|0|0", "0|0|0|102"))
    found = wished(two_materials("uint8"), str(file))
    air, *others = extinction(found.transfer, 0, 60, 200)
    assert air == 0 < min(others)
    assert any("which are the background here" in note for note in found.outlier_notes)


def test_words_name_the_material_that_they_show() -> None:
    """Without Hounsfield units nobody knows that what is dense is bone, or a vessel."""
    assert {layer.name for layer in wished(two_materials("uint8"), "vessels").visible} == {
        "the surroundings",
        "the densest material",
    }
    assert [layer.name for layer in wished(two_materials("uint8"), "bone").visible] == ["the densest material"]
    assert [layer.name for layer in wished(head_as_unsigned(), "bone").visible] == ["bone and contrast medium"]


def test_a_single_material_has_no_veil() -> None:
    sample = sample_volume(volume_of(fading(255)), compute_statistics(fading(255)))
    (layer,) = WISHES["vessels"](Materials((0.1, 1.0), sample, None)).layers
    assert layer.name == "the object" and layer.knots[0] == (0.1, 0.0)
