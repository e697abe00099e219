"""Samples of formats whose headers are binary, of cube files, of NumPy and of pictures."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from statement_samples import Sample, Samples, Writer
from volume_files import written

Places = Mapping[str, tuple[int, str]]

# Where fields of MRC and of CCP4 are, and their type.
_MRC: Places = {
    "mode": (12, "i"),
    "nxstart": (16, "i"),
    "mx": (28, "i"),
    "mz": (36, "i"),
    "cella": (40, "f"),
    "cellb": (52, "f"),
    "mapc": (64, "i"),
    "mapr": (68, "i"),
    "dmax": (80, "f"),
    "ispg": (88, "i"),
    "lskflg": (96, "i"),
    "skwtrn": (136, "f"),
    "imodStamp": (152, "i"),
    "imodFlags": (156, "i"),
    "origin": (196, "f"),
}
_IMOD = 1146047817

# Where fields of MGH are; the time between frames is behind them and the voxels.
_MGH: Places = {
    "frames": (16, ">i"),
    "goodRASFlag": (28, ">h"),
    "delta": (30, ">f"),
    "Mdc": (42, ">f"),
    "Pxyz_c": (78, ">f"),
    "tr": (284 + 24, ">f"),
}


def _mrc(**fields: float) -> Writer:
    data = bytearray(1024)
    struct.pack_into("<10i6f3i", data, 0, 2, 3, 4, 0, 0, 0, 0, 2, 3, 4, 2, 3, 4, 90, 90, 90, 1, 2, 3)
    data[208:216] = b"MAP DD\0\0"
    return lambda folder: written(folder / "a.mrc", _changed(data + bytes(range(120, 144)), _MRC, fields))


def _mgh(**fields: float) -> Writer:
    data = bytearray(284 + 24 + 20)
    struct.pack_into(">7ih15f", data, 0, 1, 2, 3, 4, 1, 0, 0, 1, 1, 1, 1, -1, 0, 0, 0, 0, -1, 0, 1, 0, 0, 0, 0)
    data[284 : 284 + 24] = range(24)
    if "frames" in fields:
        struct.pack_into(">2i", data, 12, 2, 2)
    return lambda folder: written(folder / "a.mgh", _changed(data, _MGH, fields))


def _changed(data: bytes, places: Places, fields: Mapping[str, float]) -> bytes:
    changed = bytearray(data)
    for name, value in fields.items():
        place, kind = places[name]
        struct.pack_into(kind if kind[0] == ">" else "<" + kind, changed, place, value)
    return bytes(changed)


_CUBE = "a\nb\n{atoms} {origin} 0 0{values}\n{sign}2 {step} 0 0\n{sign}3 0 1 0\n{sign}4 0 0 1\n1 1 0 0 0\n{orbitals}"


def _cube(**parts: str) -> Writer:
    given = {"atoms": "1", "origin": "0", "values": "", "sign": "", "step": "1", "orbitals": ""} | parts
    count = 1 + ("orbitals" in parts or "values" in parts)
    numbers = " ".join(map(str, range(24 * count)))
    return lambda folder: written(folder / "a.cube", (_CUBE.format(**given) + numbers).encode())


def _npy(values: Any) -> Writer:
    def write(folder: Path) -> Path:
        np.save(folder / "a.npy", values)
        return folder / "a.npy"

    return write


_NUMBERS = np.arange(24, dtype="<u2").reshape(2, 3, 4)


_FLIPPED = {"mapc": 2, "mapr": 1}
_IN_TIME = {"frames": 2}

SAMPLES: Samples = {
    "MRC and CCP4": {
        "mapc": Sample(_mrc(cella=9.0), _mrc(cella=9.0, **_FLIPPED)),
        "cella": Sample(_mrc(), _mrc(cella=9.0)),
        "mx": Sample(_mrc(), _mrc(mx=8)),
        "cellb": Sample(_mrc(), _mrc(cellb=60.0)),
        "origin": Sample(_mrc(), _mrc(origin=5.0)),
        "nxstart": Sample(_mrc(), _mrc(nxstart=5)),
        "ispg": Sample(_mrc(mz=2), _mrc(mz=2, ispg=401)),
        "imodFlags": Sample(_mrc(imodStamp=_IMOD), _mrc(imodStamp=_IMOD, imodFlags=1)),
        "dmax": Sample(_mrc(), _mrc(dmax=200.0)),
        "lskflg": Sample(_mrc(skwtrn=1.0), _mrc(skwtrn=1.0, lskflg=1)),
    },
    "MGH": {
        "delta": Sample(_mgh(), _mgh(delta=2.0)),
        "Mdc": Sample(_mgh(), _mgh(Mdc=1.0)),
        "Pxyz_c": Sample(_mgh(), _mgh(Pxyz_c=5.0)),
        "goodRASFlag": Sample(_mgh(delta=2.0), _mgh(delta=2.0, goodRASFlag=0)),
        "tr": Sample(_mgh(**_IN_TIME), _mgh(**_IN_TIME, tr=2500.0)),
    },
    "Gaussian cube": {
        "origin": Sample(_cube(), _cube(origin="5")),
        "axes": Sample(_cube(), _cube(step="2")),
        "sign of the number of voxels": Sample(_cube(), _cube(sign="-")),
        "sign of the number of atoms": Sample(_cube(values=" 2"), _cube(atoms="-1", orbitals="2 7 8\n")),
        "NVal": Sample(_cube(), _cube(values=" 2")),
    },
    "NumPy": {
        "descr": Sample(_npy(_NUMBERS), _npy(_NUMBERS.view(">u2"))),
        "fortran_order": Sample(_npy(_NUMBERS), _npy(_NUMBERS.ravel().reshape(2, 3, 4, order="F"))),
    },
}
