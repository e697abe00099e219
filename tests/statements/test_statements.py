"""Every entry of the readers' tables of statements: a file that has the field differs from one that has not, as the
entry says, or a note names the field."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from formats_page import format_tables
from statement_samples import Sample
from volume_files import read

from renderer.readers import Statement
from renderer.volume import Volume

pytestmark = pytest.mark.usefixtures("one_process")

_HERE = Path(__file__).resolve().parent
_SAMPLES: dict[str, dict[str, Sample]] = {}
for _file in sorted(_HERE.glob("stated_*.py")):
    _SAMPLES |= importlib.import_module(_file.stem).SAMPLES
_ENTRIES = [(table.format, each) for table in format_tables() for each in table.statements]


def _stated(volume: Volume, effect: str) -> Any:
    """Return the part of a volume that a statement of this effect changes, as plain data."""
    affine, values = volume.world_from_index.tolist(), volume.values.tobytes()
    times = (volume.num_times, volume.times, volume.time_unit)
    units = (volume.length_unit, volume.world_axes, volume.value_unit)
    return {
        "values": (values, volume.values.dtype.str),
        "place": (affine, values),
        "validity": (volume.num_absent, np.isnan(volume.values).tobytes()),
        "meaning": (volume.channels, volume.labels, times, units, volume.note),
    }[effect]


@pytest.mark.parametrize(("form", "entry"), _ENTRIES, ids=lambda each: getattr(each, "field", each))
def test_no_statement_is_passed_over(tmp_path: Path, form: str, entry: Statement) -> None:
    sample = _SAMPLES[form][entry.field]
    volumes = []
    for name, write in (("plain", sample.plain), ("stated", sample.stated)):
        (tmp_path / name).mkdir()
        volumes.append(read(write(tmp_path / name), **sample.choice))
    plain, stated = volumes
    if entry.is_applied:
        assert _stated(stated, entry.effect) != _stated(plain, entry.effect)
    else:
        assert stated.note is not None and entry.field in stated.note
    assert plain.note is None or "not applied" not in plain.note


def test_every_sample_belongs_to_an_entry() -> None:
    entries = {(form, each.field) for form, each in _ENTRIES}
    assert {(form, field) for form, samples in _SAMPLES.items() for field in samples} == entries
