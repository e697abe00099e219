"""Legal scenes with something wrong in them: a value, a key, the text, a file or the command line.

Not everything that is done here makes a scene illegal: a file with other bytes may hold another volume. What comes out
is judged by what the program says to it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import yaml
from scenes import Case, Random
from spoiling import places

NAN, INF = float("nan"), float("inf")

# None of these is a number of frames, pixels or voxels that would keep a machine busy.
WRONG_VALUES: tuple[Any, ...] = (
    None, "text", "", [], {}, NAN, INF, -INF, -1, 0, 1e300, -1e300, 1e-320, 10**30, -(10**30), True, False, "1e400",
    "0x10", "nan", [1, 2], [NAN, 0, 0], [[1]], {"a": 1}, {"file": "x"}, 0.5, -0.0, "\0", "\u202e", "a" * 3000,
    "1_000", [1e300, 1e300, 1e300], [-1, -1, -1], "transparent", "visible",
)  # fmt: skip


def spoil(case: Case, rng: Random) -> Case:
    """The case with one thing changed, `spoilt` saying which; it is drawn from its files."""
    if case.in_memory:
        case.in_memory = False
    change = _CHANGES[int(rng.choice(len(_CHANGES), p=_SHARES))]
    case.spoilt = change.__name__.removeprefix("_")
    change(case, rng)
    return case


def _any_place(case: Case, rng: Random) -> tuple[Any, Any, tuple[Any, ...]]:
    every = list(places(case.tree))
    return every[int(rng.integers(len(every)))]


def _wrong_value(rng: Random) -> Any:
    return WRONG_VALUES[int(rng.integers(len(WRONG_VALUES)))]


def _value(case: Case, rng: Random) -> None:
    container, key, _ = _any_place(case, rng)
    container[key] = _wrong_value(rng)


def _number(case: Case, rng: Random) -> None:
    """By a factor: out of all proportion, or next to it."""
    numbers = [(container, key) for container, key, _ in places(case.tree) if isinstance(container[key], float)]
    if not numbers:
        _value(case, rng)
        return
    container, key = numbers[int(rng.integers(len(numbers)))]
    factors = [-1.0, *(10.0**power for power in (-300, -30, -20, -12, -6, 6, 12, 20, 29, 30, 300))]
    container[key] = float(container[key] * factors[int(rng.integers(len(factors)))])


def _missing_key(case: Case, rng: Random) -> None:
    container, key, _ = _any_place(case, rng)
    del container[key]


def _unknown_key(case: Case, rng: Random) -> None:
    container, *_ = _any_place(case, rng)
    if isinstance(container, dict):
        name = ["tolernace", "x", 7, None, 1.5, True, "a.b", "\n", "fovy"][int(rng.integers(9))]
        container[name] = _wrong_value(rng)
    else:
        container.append(_wrong_value(rng))


def _text(case: Case, rng: Random) -> None:
    """Of the scene file."""
    text = yaml.safe_dump(case.tree, sort_keys=False).encode()
    cut = int(rng.integers(len(text)))
    case.text = [
        text[:cut],
        *(
            text[:cut] + more + text[cut:]
            for more in (rng.bytes(int(rng.integers(1, 9))), b"\t", b'"', b"{", b": ", b"*a", b"\x00")
        ),
        *(text + more for more in (b"---\n" + text, text, b"a: &a [*a]\n", b"a: " + b"[" * 5000, b"a: &a {b: *a}\n")),
        text + b"b: !!python/object/apply:os.system [true]\n",
        text.replace(b"version: 1", b"version: 2"),
        text.replace(b"\n", b"\r"),
        b"\xff\xfe" + text.decode().encode("utf-16-le"),
        *(rng.bytes(300), b"", b"[1, 2]", b"# nothing\n"),
        b"a: &a [x,x,x,x,x,x,x,x,x]\n"
        + b"".join(b"%c: &%c [%s]\n" % (c, c, b",".join([b"*%c" % (c - 1)] * 9)) for c in range(98, 106)),
    ][int(rng.integers(22))]


def _file(case: Case, rng: Random) -> None:
    """Of the voxels: cut short, lengthened, with other bytes, missing, of another format, or a folder."""
    if not case.files:
        case.files["v.npy"] = b"\x93NUMPY\x01\x00"
        case.tree["volume"] = {"file": "v.npy"}
    names = sorted(case.files)
    name = names[int(rng.integers(len(names)))]
    data = case.files[name]
    cut = int(rng.integers(max(len(data), 1)))
    kind = int(rng.integers(8))
    if kind < 2:
        case.files[name] = data[:cut]
    elif kind == 2:
        case.files[name] = data + rng.bytes(5)
    elif kind < 6:  # in the header, mostly
        garbled = bytearray(data)
        for _ in range(int(rng.integers(1, 5))):
            if garbled:
                garbled[int(rng.integers(min(len(garbled), 400)))] = int(rng.integers(256))
        case.files[name] = bytes(garbled)
    elif kind == 6:
        del case.files[name]
    else:
        case.files[name] = rng.bytes(len(data))


def _option(case: Case, rng: Random) -> None:
    """Of the command line."""
    path = ".".join(map(str, _any_place(case, rng)[2]))
    value = yaml.safe_dump(_wrong_value(rng), default_flow_style=True).strip().removesuffix("...").strip()
    options = [
        ["--set", f"{path}={value}"],
        ["--set", path],
        ["--set", f"{path}.x.y={value}"],
        ["--set", f"{path}=[1, 2"],
        ["--set", f"{path}=&a [*a]"],
        ["--output", "\udcff.gif"],
        ["--volume", "scene.yaml"],
        ["--frames", "10000000000000000000000"],
    ]
    case.arguments += options[int(rng.integers(len(options)))]


def _voxels(case: Case, rng: Random) -> None:
    """Infinities and no numbers among them."""
    assert case.volume is not None
    with np.errstate(over="ignore"):  # more infinities
        values = case.volume.values.astype(np.float32 if rng.random() < 0.5 else np.float64, order="C")
    for _ in range(int(rng.integers(1, 4))):
        values[tuple(int(rng.integers(n)) for n in values.shape)] = [NAN, INF, -INF][int(rng.integers(3))]
    case.files["n.raw"] = values.tobytes()
    case.tree["volume"] = {"raw": {"file": "n.raw", "shape": list(values.shape[::-1]), "dtype": values.dtype.name}}
    if rng.random() < 0.5:
        case.tree["volume"]["nodata"] = "auto"


_CHANGES = (_value, _number, _missing_key, _unknown_key, _text, _file, _option, _voxels)
_SHARES = (0.25, 0.15, 0.1, 0.1, 0.12, 0.12, 0.12, 0.04)
