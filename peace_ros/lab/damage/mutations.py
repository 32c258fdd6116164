# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Ways in which a file is damaged, each by a seeded generator."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

_EXTREMES = (0, 1, 0x7F, 0x80, 0xFF, 0x7FFF, 0xFFFF, 2**31 - 1, 2**31, 2**32 - 1, 2**63 - 1, 2**63)
_WIDTHS = (1, 2, 4, 8)
_MOST_FLIPS = 16


def damaged(content: bytes, rng: np.random.Generator) -> tuple[str, bytes]:
    """Return how the content was damaged, and the result.

    Args:
        content: of an intact file.
        rng: chooses; the same state gives the same damage.
    """
    names = list(_WAYS)
    name = names[int(rng.integers(len(names)))]
    data = bytearray(content)
    if data:
        _WAYS[name](data, rng)
    return name, bytes(data)


def _place(data: bytearray, rng: np.random.Generator) -> int:
    """Return a place; every second one is where headers and indices are, at one of the ends."""
    if rng.random() < 0.5:
        return int(rng.integers(len(data)))
    near = int(rng.integers(min(len(data), 4096)))
    return near if rng.random() < 0.5 else len(data) - 1 - near


def _flip_bits(data: bytearray, rng: np.random.Generator) -> None:
    for _ in range(int(rng.integers(1, _MOST_FLIPS + 1))):
        data[_place(data, rng)] ^= 1 << int(rng.integers(8))


def _cut(data: bytearray, rng: np.random.Generator) -> None:
    del data[_place(data, rng) :]


def _cut_out(data: bytearray, rng: np.random.Generator) -> None:
    begin = _place(data, rng)
    del data[begin : begin + _length(data, rng)]


def _overwrite(data: bytearray, rng: np.random.Generator) -> None:
    begin = _place(data, rng)
    end = min(len(data), begin + _length(data, rng))
    data[begin:end] = rng.bytes(end - begin) if rng.random() < 0.5 else bytes(end - begin)


def _repeat(data: bytearray, rng: np.random.Generator) -> None:
    begin, to = _place(data, rng), _place(data, rng)
    data[to:to] = data[begin : begin + _length(data, rng)]


def _put_extreme(data: bytearray, rng: np.random.Generator) -> None:
    """Write a number out of range over a field; counts, sizes and times are such fields."""
    width = int(rng.choice(_WIDTHS))
    value = int(_EXTREMES[int(rng.integers(len(_EXTREMES)))]) % (1 << 8 * width)
    begin = _place(data, rng)
    order = 'little' if rng.random() < 0.5 else 'big'
    data[begin : begin + width] = value.to_bytes(width, order)  # type: ignore[arg-type]


def _length(data: bytearray, rng: np.random.Generator) -> int:
    return int(rng.integers(1, max(2, len(data) // 8)))


_WAYS: dict[str, Callable[[bytearray, np.random.Generator], None]] = {
    'bits flipped': _flip_bits,
    'cut short': _cut,
    'a part cut out': _cut_out,
    'a part overwritten': _overwrite,
    'a part repeated': _repeat,
    'a field out of range': _put_extreme,
}
