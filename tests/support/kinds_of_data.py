"""Small volumes of every kind of data, from formulas and seeded noise, for tests of suggestions."""

from __future__ import annotations

from hashlib import sha256

import numpy as np

from renderer.scene import TransferSpec
from renderer.statistics import VoxelSample, compute_statistics, sample_volume
from renderer.suggest import Suggestion, Wish, suggest
from renderer.transfer import make_transfer_function
from renderer.volume import Array, Volume, make_volume

N = 48
# The suggestions that `suggested` has computed.
_SUGGESTED = dict[tuple[object, ...], Suggestion]()


def volume_of(values: Array, spacing: float = 1.0) -> Volume:
    """Return a volume of cubic voxels."""
    return make_volume(np.ascontiguousarray(values), np.diag([spacing] * 3 + [1.0]), "made up")


def sample_of(values: Array, spacing: float = 1.0) -> VoxelSample:
    """Return the sample of voxels from which a look is suggested."""
    volume = volume_of(values, spacing)
    return sample_volume(volume, compute_statistics(volume.values))


def suggested(values: Array, spacing: float = 1.0, colormap: str | None = None) -> Suggestion:
    """Return the look that is suggested for a volume of these values, which is computed once for all tests."""
    key = sha256(np.ascontiguousarray(values)).digest(), values.dtype.str, values.shape, spacing, colormap
    if key not in _SUGGESTED:
        volume = volume_of(values, spacing)
        _SUGGESTED[key] = suggest(volume, compute_statistics(volume.values), Wish(colormap))
    return _SUGGESTED[key]


def extinction(transfer: TransferSpec, *values: float, spacing: float = 1.0) -> list[float]:
    """Return the extinction that a transfer function gives to each value, or label."""
    if transfer.labels is not None:
        shown = transfer.labels.values
        values = tuple(shown.index(each) + 1 if each in shown else 0 for each in values)
    return list(make_transfer_function(transfer, spacing).classify(np.array(values))[1])


def axes(n: int = N) -> tuple[Array, Array, Array]:
    """Return the coordinates z, y, x of voxels, from -1 to 1, [n, n, n] each."""
    z, y, x = np.meshgrid(*[np.linspace(-1, 1, n)] * 3, indexing="ij")
    return z, y, x


def ball(centre: tuple[float, float, float], radius: float, n: int = N) -> Array:
    """Return whether each voxel is in a ball, [n, n, n]. centre (z, y, x), radius: in halves of the volume's side."""
    return np.sqrt(sum((axis - c) ** 2 for axis, c in zip(axes(n), centre, strict=True))) < radius


def blurred(values: Array) -> Array:
    """Return means of values over boxes of 3 x 3 x 3 voxels."""
    for axis in range(3):
        padded = np.pad(values, [(1, 1) if k == axis else (0, 0) for k in range(3)], mode="edge")
        values = sum(np.take(padded, np.arange(k, k + values.shape[axis]), axis) for k in range(3)) / 3
    return values


def noise(seed: int, n: int = N) -> Array:
    """Return normally distributed noise of standard deviation 1, [n, n, n]."""
    return np.random.Generator(np.random.PCG64(seed)).normal(size=(n, n, n))


def head_in_hounsfield_units(n: int = N) -> Array:
    """Return a CT scan, int16: a skull with a hole, brain, a table, and padding outside of the scanner's circle."""
    _, y, x = axes(n)
    values = np.full((n, n, n), -1000.0)
    values[(np.abs(y - 0.85) < 0.06) & (np.abs(x) < 0.5)] = -100
    values[ball((0, 0, 0), 0.7, n)] = 40
    values[ball((0, 0, 0), 0.62, n) & ~ball((0, -0.6, 0), 0.2, n)] = 1100
    values[ball((0, 0, 0), 0.52, n)] = 35
    values = np.maximum(blurred(values) + 15 * noise(1, n), -1024)
    values[x**2 + y**2 > 1] = -3024
    return values.astype(np.int16)


def head_as_unsigned() -> Array:
    """Return `head_in_hounsfield_units` plus 1024, as uint16, and without padding."""
    return (np.maximum(head_in_hounsfield_units().astype(np.int32), -1024) + 1024).astype(np.uint16)


def magnetic_resonance() -> Array:
    """Return an MR scan, int16: a head with fat around the brain, uneven brightness, and noise of a magnitude image."""
    _, y, x = axes()
    values = np.zeros((N, N, N))
    values[ball((0, 0, 0), 0.8)] = 700
    values[ball((0, 0, 0), 0.7)] = 60
    values[ball((0, 0, 0), 0.64)] = 380
    values[ball((0, 0.2, 0.2), 0.25)] = 520
    values = blurred(values) * np.exp(-0.4 * ((x + 0.4) ** 2 + (y - 0.2) ** 2))
    return np.hypot(values + 20 * noise(2), 20 * noise(3)).astype(np.int16)


def microscopy() -> Array:
    """Return a microscope's image, uint16: bright points on a noisy ground."""
    values = np.zeros((N, N, N))
    generator = np.random.Generator(np.random.PCG64(4))
    for z, y, x in generator.integers(3, N - 3, (40, 3)):
        values[z, y, x] += generator.uniform(20_000, 60_000)
    return np.clip(blurred(blurred(values)) + 110 + 12 * noise(5), 0, 65535).astype(np.uint16)


def two_materials(dtype: str) -> Array:
    """Return a block of a low value with balls of a high value in it. dtype: an unsigned type, whose range is used."""
    scale = np.iinfo(dtype).max / 255
    values = np.full((N, N, N), 12.0)
    values[8:-8, 8:-8, 8:-8] = 95
    values[ball((0.2, 0.2, 0), 0.3) | ball((-0.3, -0.2, 0.1), 0.2)] = 220
    return np.clip((blurred(values) + 3 * noise(6)) * scale, 0, np.iinfo(dtype).max).astype(dtype)


def two_materials_and(num: int, far: float) -> Array:
    """Return `two_materials` from 0 to 255, float32, and a value `far` from them in the first `num` voxels."""
    values = two_materials("uint8").astype(np.float32)
    values.ravel()[:num] = far
    return values


def signed() -> Array:
    """Return a positive and a negative lobe that fade to 0, float32."""
    z, y, x = axes()
    return (x * np.exp(-6 * (x**2 + y**2 + z**2))).astype(np.float32)


def filled_signed() -> Array:
    """Return waves of both signs up to the border, float32."""
    z, y, x = axes()
    waves = (np.sin(7 * x + 2 * y) * np.cos(6 * y - z), np.sin(9 * z + x), np.cos(5 * x - 6 * z + 1))
    return np.asarray(sum(waves) - np.mean(sum(waves)), np.float32)


def density() -> Array:
    """Return a density that falls off over more than six orders of magnitude, float32."""
    z, y, x = axes()
    return (1e-24 * np.exp(-14 * np.sqrt(x**2 + y**2 + z**2))).astype(np.float32)


def plume() -> Array:
    """Return a smooth plume with nothing around it, float64: a tiny range of values on a large offset."""
    z, y, x = axes()
    return 3e-9 + 1e-12 * np.exp(-(x**2 + y**2) / (0.02 + 0.05 * (z + 1)) - z**2)


def labels() -> Array:
    """Return labels of a body and of three organs in it, uint8."""
    values = np.zeros((N, N, N), np.uint8)
    for number, (centre, radius) in enumerate(
        (((0.0, 0.0, 0.0), 0.85), ((0.3, 0.0, 0.0), 0.25), ((-0.3, 0.2, 0.0), 0.25), ((0.0, -0.4, 0.3), 0.2))
    ):
        values[ball(centre, radius)] = (1, 2, 3, 11)[number]
    return values


def many_labels() -> Array:
    """Return labels of 64 boxes, which a ball cuts off, uint16."""
    z, y, x = np.meshgrid(*[np.arange(N) // 12] * 3, indexing="ij")
    return np.where(ball((0, 0, 0), 0.95), 1 + x + 4 * y + 16 * z, 0).astype(np.uint16)


def dark_object() -> Array:
    """Return a dark object on a background of the brightest value, uint8."""
    return (255 - two_materials("uint8")).astype(np.uint8)


def phases() -> Array:
    """Return a stone with pores that fills the volume, uint8."""
    z, y, x = axes()
    pores = np.sin(8 * x) + np.sin(8 * y + 1) + np.sin(8 * z + 2)
    return np.clip(np.where(pores > 0.2, 60, 150) + 8 * noise(7), 0, 255).astype(np.uint8)


def temperature() -> Array:
    """Return temperatures of a room with a hot spot, float32: the volume has no background."""
    z, y, x = axes()
    return (293 + 20 * z + 60 * np.exp(-(x**2 + y**2 + z**2) / 0.1)).astype(np.float32)


def distance() -> Array:
    """Return the signed distance from two balls that touch, negative inside, float32."""
    z, y, x = axes()
    return np.minimum(np.sqrt((x - 0.3) ** 2 + y**2 + z**2) - 0.4, np.sqrt((x + 0.4) ** 2 + y**2 + z**2) - 0.3).astype(
        np.float32
    )


# By name: the values of a volume, and the kind of data that a suggestion should take it for.
KINDS: dict[str, tuple[Array, str]] = {
    "head": (head_in_hounsfield_units(), "CT in Hounsfield units"),
    "head as float32": (head_in_hounsfield_units().astype(np.float32), "CT in Hounsfield units"),
    "head as uint16": (head_as_unsigned(), "CT in Hounsfield units"),
    "magnetic resonance": (magnetic_resonance(), "scan without an absolute scale"),
    "microscopy": (microscopy(), "smooth field"), "uint8": (two_materials("uint8"), "scan without an absolute scale"),
    "uint16": (two_materials("uint16"), "scan without an absolute scale"),
    "12 bits": (two_materials("uint16") // 16, "scan without an absolute scale"),
    "signed": (signed(), "field with two signs"), "filled, signed": (filled_signed(), "field with two signs"),
    "density": (density(), "field with a long tail"), "plume": (plume(), "smooth field"),
    "labels": (labels(), "labels"), "labels as float64": (labels().astype(np.float64), "labels"),
    "many labels": (many_labels(), "labels"), "mask": ((labels() > 1).astype(np.uint8) * 255, "mask"),
    "inverted mask": (((labels() < 2) * 2).astype(np.float32), "mask"),
    "dark object": (dark_object(), "scan without an absolute scale, dark in a bright background"),
    "phases": (phases(), "two phases"), "distance": (distance(), "level set"),
    "distance, reversed": (-distance(), "level set"), "temperature": (temperature(), "filled volume"),
    "constant": (np.full((N, N, N), -7.5), "constant volume"),
}  # fmt: skip
