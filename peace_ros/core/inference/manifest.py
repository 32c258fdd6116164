# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What manifest.json of a model bundle may say, read strictly."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from math import isfinite
from types import MappingProxyType
from typing import Any

from peace_ros.core.domain import BundleError

FORMAT = 1
ROLES_BY_FAMILY: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        'clip': ('image_encoder', 'text_encoder', 'tokenizer'),
        'clipseg': ('image_encoder', 'text_encoder', 'decoder', 'tokenizer'),
        'fastsam': ('segmenter', 'image_encoder', 'text_encoder', 'tokenizer'),
    }
)
RESIZES_BY_FAMILY: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        'clip': ('stretch', 'crop'),
        # A heatmap covers the whole frame, so a segmenter must see the whole frame.
        'clipseg': ('stretch',),
        'fastsam': ('letterbox',),
    }
)
INTERPOLATIONS = ('area', 'bilinear', 'bicubic')
PRECISIONS = ('fp32', 'fp16', 'int8')
MAX_INPUT_PX = 4096
LOGIT_SCALE = 100.0
"""exp of the temperature at which CLIP's training was held (Radford et al. 2021, section 2.5)."""
_SHA256 = re.compile(r'[0-9a-f]{64}')
THRESHOLDS = (0.01, 0.99)
"""Scores that a bundle may recommend to call ground safe from; beyond them all is called so, or
nothing."""
_FILE_NAME = re.compile(r'[A-Za-z0-9_][A-Za-z0-9_.\-]*')


@dataclass(frozen=True)
class InputSpec:
    """How an image becomes the network's input."""

    width: int
    height: int
    resize: str
    """``stretch`` to width x height, ``crop``: shorter side first, then the centre, or
    ``letterbox``: the longer side first, then borders around it."""
    mean: tuple[float, float, float]
    std: tuple[float, float, float]
    """RGB, of values 0 to 1."""
    interpolation: str = 'area'
    """``area`` averages; ``bilinear`` and ``bicubic`` are Pillow's, as CLIP and CLIPSeg learned."""


@dataclass(frozen=True)
class FileEntry:
    """What the manifest says of one file."""

    sha256: str
    bytes: int


@dataclass(frozen=True)
class Manifest:
    """The content of manifest.json."""

    name: str
    family: str
    roles: Mapping[str, str]
    """Role -> file name."""
    input: InputSpec
    embedding_width: int
    context_length: int
    """Most tokens that the text encoder takes."""
    precision: str
    files: Mapping[str, FileEntry]
    licence: str
    provenance: str
    recommended: Mapping[str, float]
    """Advice for those who use the model, e.g. ``threshold`` on the safety score."""
    crop_input: InputSpec | None = None
    """Family fastsam: how a segment goes into the image encoder; None in other families."""
    logit_scale: float = LOGIT_SCALE
    """What CLIP multiplies cosine similarities by before a softmax."""
    verification: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    """How well the export agreed with its reference, e.g. ``cosine``; empty: not recorded."""

    @property
    def encoder_input(self) -> InputSpec:
        """How an image goes into the image encoder."""
        return self.crop_input or self.input


class _Reader:
    """Takes typed values out of a JSON object; every refusal names file, key, value and remedy."""

    def __init__(self, where: str, values: Mapping[str, Any]) -> None:
        self.where = where
        self._values = values

    def refuse(self, key: str, remedy: str) -> BundleError:
        value = self._values.get(key, 'nothing')
        return BundleError(f'{self.where}: {key} is {value!r}; {remedy}')

    def text(self, key: str, choices: tuple[str, ...] = (), default: str | None = None) -> str:
        value = self._values.get(key, default)
        if not isinstance(value, str) or not value.strip():
            raise self.refuse(key, 'give a non-empty string')
        if choices and value not in choices:
            raise self.refuse(key, f'known are {", ".join(choices)}')
        return value

    def whole(self, key: str, low: int, high: int) -> int:
        value = self._values.get(key)
        if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
            raise self.refuse(key, f'give a whole number from {low} to {high}')
        return value

    def triple(self, key: str, *, positive: bool) -> tuple[float, float, float]:
        value = self._values.get(key)
        numbers = value if isinstance(value, list) and all(map(_is_number, value)) else []
        if len(numbers) != 3 or (positive and min(numbers) <= 0.0):
            raise self.refuse(key, f'give three {"positive " if positive else ""}numbers, RGB')
        return float(numbers[0]), float(numbers[1]), float(numbers[2])

    def positive(self, key: str, default: float) -> float:
        value = self._values.get(key, default)
        if not _is_number(value) or value <= 0.0:
            raise self.refuse(key, 'give a positive number')
        return float(value)

    def table(self, key: str, default: dict[str, Any] | None = None) -> dict[str, Any]:
        value = self._values.get(key, default)
        if not isinstance(value, dict):
            raise self.refuse(key, 'give a JSON object')
        return value


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and isfinite(value)


def parse_manifest(raw: bytes, where: str) -> Manifest:
    """Read a manifest; ``where`` names it in messages. Raises BundleError."""
    try:
        values = json.loads(raw)
    except (ValueError, RecursionError) as error:
        raise BundleError(f'{where}: not JSON ({error}); build the bundle again') from error
    if not isinstance(values, dict):
        raise BundleError(f'{where}: holds {type(values).__name__}; it must be a JSON object')
    reader = _Reader(where, values)
    if values.get('format') != FORMAT or isinstance(values.get('format'), bool):
        raise reader.refuse('format', f'this version reads format {FORMAT}')
    family = reader.text('family', tuple(ROLES_BY_FAMILY))
    files = _files(reader)
    return Manifest(
        name=reader.text('name'),
        family=family,
        roles=_roles(reader, family, files),
        input=_input(reader, 'input', family),
        embedding_width=reader.whole('embedding_width', 1, 65536),
        context_length=reader.whole('context_length', 3, 4096),
        precision=reader.text('precision', PRECISIONS),
        files=files,
        licence=reader.text('licence'),
        provenance=reader.text('provenance'),
        recommended=_numbers(reader, 'recommended'),
        crop_input=_input(reader, 'crop_input', family) if family == 'fastsam' else None,
        logit_scale=reader.positive('logit_scale', LOGIT_SCALE),
        verification=_numbers(reader, 'verification'),
    )


def _files(reader: _Reader) -> Mapping[str, FileEntry]:
    files = {}
    for name, entry in reader.table('files').items():
        if not _FILE_NAME.fullmatch(name):
            raise BundleError(
                f'{reader.where}: file {name!r}: name files inside the bundle, without a folder'
            )
        where = f'{reader.where}: files: {name}'
        if not isinstance(entry, dict):
            raise BundleError(f'{where}: {entry!r}; give an object with sha256 and bytes')
        values = _Reader(where, entry)
        sha256 = values.text('sha256')
        if not _SHA256.fullmatch(sha256):
            raise values.refuse('sha256', 'give 64 lower-case hex digits')
        files[name] = FileEntry(sha256, values.whole('bytes', 1, 1 << 40))
    return MappingProxyType(files)


def _roles(reader: _Reader, family: str, files: Mapping[str, FileEntry]) -> Mapping[str, str]:
    needed = ROLES_BY_FAMILY[family]
    roles = _Reader(f'{reader.where}: roles', reader.table('roles'))
    found = {role: roles.text(role) for role in needed}
    for role, name in found.items():
        if name not in files:
            raise roles.refuse(role, f'list that file under files, known are {", ".join(files)}')
    unknown = sorted(set(reader.table('roles')) - set(needed))
    if unknown:
        raise BundleError(
            f'{reader.where}: roles: {", ".join(unknown)} unknown to family {family}; '
            f'it has {", ".join(needed)}'
        )
    return MappingProxyType(found)


def _input(manifest: _Reader, key: str, family: str) -> InputSpec:
    reader = _Reader(f'{manifest.where}: {key}', manifest.table(key))
    return InputSpec(
        width=reader.whole('width', 1, MAX_INPUT_PX),
        height=reader.whole('height', 1, MAX_INPUT_PX),
        resize=reader.text('resize', RESIZES_BY_FAMILY[family]),
        mean=reader.triple('mean', positive=False),
        std=reader.triple('std', positive=True),
        interpolation=reader.text('interpolation', INTERPOLATIONS, default='area'),
    )


def _numbers(reader: _Reader, key: str) -> Mapping[str, float]:
    """Return an optional table of numbers."""
    values = reader.table(key, {})
    for name, value in values.items():
        if not _is_number(value):
            raise BundleError(f'{reader.where}: {key}: {name} is {value!r}; give a number')
    return MappingProxyType({name: float(value) for name, value in values.items()})
