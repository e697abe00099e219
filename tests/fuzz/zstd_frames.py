"""Zstandard frames with a checksum, which imagecodecs does not write."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import Any

import imagecodecs
import numpy.typing as npt

Array = npt.NDArray[Any]


def zstd_with_checksums(pages: Array) -> Iterator[bytes]:
    """Yield a frame for each page with its checksum, which imagecodecs does not write: a bit in the descriptor, and
    the low half of XXH64 at the end (RFC 8878)."""
    for page in pages:
        data = page.tobytes()
        frame = bytearray(imagecodecs.zstd_encode(data))
        frame[4] |= 4
        yield bytes(frame) + struct.pack("<I", xxh64(data) & 0xFFFFFFFF)


_PRIMES = (0x9E3779B185EBCA87, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9, 0x85EBCA77C2B2AE63, 0x27D4EB2F165667C5)
_MASK = 2**64 - 1


def xxh64(data: bytes) -> int:
    """Return the XXH64 of some bytes, with the seed 0."""
    first, second, third, fourth, fifth = _PRIMES

    def turned(x: int, bits: int) -> int:
        return (x << bits | x >> 64 - bits) & _MASK

    def mixed(lane: int, word: int) -> int:
        return turned((lane + word * second) & _MASK, 31) * first & _MASK

    at, end = 0, len(data)
    if end >= 32:
        lanes = [(first + second) & _MASK, second, 0, -first & _MASK]
        while at + 32 <= end:
            lanes = [mixed(lane, word) for lane, word in zip(lanes, struct.unpack_from("<4Q", data, at), strict=True)]
            at += 32
        total = sum(turned(lane, bits) for lane, bits in zip(lanes, (1, 7, 12, 18), strict=True)) & _MASK
        for lane in lanes:
            total = ((total ^ mixed(0, lane)) * first + fourth) & _MASK
    else:
        total = fifth
    total = (total + end) & _MASK
    while at + 8 <= end:
        total = (turned(total ^ mixed(0, struct.unpack_from("<Q", data, at)[0]), 27) * first + fourth) & _MASK
        at += 8
    if at + 4 <= end:
        total = (turned(total ^ struct.unpack_from("<I", data, at)[0] * first & _MASK, 23) * second + third) & _MASK
        at += 4
    for byte in data[at:]:
        total = turned(total ^ byte * fifth & _MASK, 11) * first & _MASK
    total = (total ^ total >> 33) * second & _MASK
    total = (total ^ total >> 29) * third & _MASK
    return total ^ total >> 32
