"""What real volumes are taken for."""

from __future__ import annotations

from pathlib import Path

import pytest

from renderer.readers import read_volume
from renderer.scene import FileSource, VolumeSpec
from renderer.suggest import compute_statistics, suggest


@pytest.mark.real_data
@pytest.mark.parametrize(
    ("file", "kind"),
    [
        ("engine.nhdr", "scan without an absolute scale"),
        ("bonsai.nhdr", "scan without an absolute scale"),
        ("hydrogenAtom.nhdr", "smooth data"),
        ("neghip.nhdr", "smooth data"),
        ("marschnerlobb.nhdr", "filled volume"),
        ("medical/headsq_quarter.nrrd", "CT in Hounsfield units"),
        ("medical/LIDC2.mha", "scan without an absolute scale"),
        ("medical/t1_dicom_part", "scan without an absolute scale"),
    ],
)
def test_kind(data_dir: Path, file: str, kind: str) -> None:
    volume = read_volume(VolumeSpec(FileSource(data_dir / file)))
    assert suggest(volume, compute_statistics(volume.values)).kind == kind
