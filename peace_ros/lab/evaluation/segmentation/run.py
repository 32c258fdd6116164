# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Every labelled image through every configuration, once."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import Frame, ImageError
from peace_ros.lab.evaluation.segmentation.cores import Cores
from peace_ros.lab.evaluation.segmentation.errors import DatasetError, SampleError
from peace_ros.lab.evaluation.segmentation.histograms import BINS, LABELS, count_labels, count_terms
from peace_ros.lab.evaluation.segmentation.samples import (
    Pair,
    Sample,
    SampleSource,
    Skipped,
    nearest,
)
from peace_ros.lab.evaluation.segmentation.term_labels import load_term_labels, meanings_of
from peace_ros.lab.evaluation.segmentation.tiles import Tile, tiles_of

Watch = Callable[[Sequence[Sample]], Iterable[Sample]]
"""Yields the samples, and may show the progress."""


@dataclass
class Tally:
    """The counts of one configuration, frame by frame."""

    terms: tuple[str, ...]
    """Terms that mean a label."""
    unscored_terms: tuple[str, ...]
    meanings: NDArray[np.bool_]
    """[every term, LABELS]."""
    names: list[str] = field(default_factory=list)
    counts: list[NDArray[np.uint32]] = field(default_factory=list)
    """Per frame [LABELS, BINS]."""
    term_counts: list[NDArray[np.uint32]] = field(default_factory=list)
    """Per frame [T, 2, BINS], of ``terms``."""
    tiles: list[int] = field(default_factory=list)
    """Per frame how many images the networks saw."""
    seconds: list[float] = field(default_factory=list)
    """Per frame the time of its prompts and heatmaps."""
    prompts: Counter[str] = field(default_factory=Counter)
    """Prompt template -> how often it was chosen."""

    @classmethod
    def of(cls, cores: Cores) -> Tally:
        """Return an empty one for a configuration."""
        terms = cores.segmenter.terms.all
        meanings = meanings_of(terms, load_term_labels())
        scored = tuple(t for t, row in zip(terms, meanings, strict=True) if row.any())
        return cls(scored, tuple(t for t in terms if t not in scored), meanings)

    @property
    def frames(self) -> int:
        """Images that were scored."""
        return len(self.names)


@dataclass(frozen=True)
class Outcome:
    """The result of an evaluation."""

    source: SampleSource
    tallies: dict[str, Tally]
    """By the name of the configuration."""
    skipped: tuple[Skipped, ...]


@dataclass(frozen=True)
class TileLook:
    """One tile of an image as a configuration sees it."""

    tile: Tile
    safety: NDArray[np.float32]
    """Of the tile, at the resolution of the image."""
    frame: Frame
    template: str
    seconds: float


def readable(
    source: SampleSource, skipped: list[Skipped], *, strict: bool = False, watch: Watch = iter
) -> Iterator[tuple[str, Pair]]:
    """Yield name, image and labels of each sample; those that cannot be scored are skipped.

    Args:
        source: labelled images.
        skipped: gets what is not scored.
        strict: refuse the first sample that cannot be scored instead of skipping it.
        watch: yields the samples, and may show the progress.

    Raises:
        DatasetError: nothing could be scored, or ``strict`` and something could not.
    """
    count = 0
    skipped += source.skipped
    for sample in watch(source.samples if not (strict and skipped) else ()):
        pair = _loaded(sample)
        if isinstance(pair, Skipped):
            skipped.append(pair)
            if strict:
                break
        else:
            count += 1
            yield sample.name, pair
    first = f'{skipped[0].name}: {skipped[0].reason}' if skipped else ''
    if strict and skipped:
        raise DatasetError(f'{first} (--strict)')
    if not count:
        reason = f'; the first of {len(skipped)}: {first}' if skipped else ''
        raise DatasetError(f'{source.title}: no image could be scored{reason}')


def _loaded(sample: Sample) -> Pair | Skipped:
    try:
        return sample.load()
    except SampleError as error:
        return Skipped(sample.name, str(error))


def cut(image_rgb: NDArray[np.uint8], tile_px: int | None) -> Iterator[tuple[Tile, Frame]]:
    """Yield the tiles of an image, see :func:`tiles_of`, as frames."""
    for tile in tiles_of(image_rgb.shape[0], image_rgb.shape[1], tile_px):
        yield tile, Frame(np.ascontiguousarray(image_rgb[tile.rows, tile.columns]), 0)


def fitted(safety: NDArray[np.float32], shape: tuple[int, ...]) -> NDArray[np.float32]:
    """Return a heatmap at the size (height, width, ...) of an image."""
    if safety.shape == shape[:2]:
        return safety
    resized = cv2.resize(safety, (shape[1], shape[0]), interpolation=cv2.INTER_LINEAR)
    return np.asarray(resized, np.float32)


def looks(
    image_rgb: NDArray[np.uint8],
    cores: Cores,
    tile_px: int | None,
    refuse: Callable[[str], object] = lambda _: None,
) -> Iterator[TileLook]:
    """Yield the heatmap of a configuration for each tile; ``refuse`` gets the reason for none.

    A flight gets no heatmap of such an image either.
    """
    for tile, frame in cut(image_rgb, tile_px):
        start = time.perf_counter()
        try:
            prompt = cores.prompt(frame)
            safety = cores.segment(frame, prompt).safety
        except ImageError as error:
            refuse(str(error))
            continue
        seconds = time.perf_counter() - start
        safety = fitted(safety, frame.image_rgb.shape)
        yield TileLook(tile, safety, frame, prompt.template, seconds)


def evaluate(
    source: SampleSource,
    configurations: list[Cores],
    *,
    tile_px: int | None = None,
    strict: bool = False,
    score_terms: bool = True,
    watch: Watch = iter,
) -> Outcome:
    """Run every configuration over every image of a source.

    Args:
        source: labelled images.
        configurations: at least one.
        tile_px: see :func:`tiles_of`; None also takes what the source suggests.
        strict: see :func:`readable`.
        score_terms: also score each term by itself; each frame is then encoded twice.
        watch: yields the samples, and may show the progress.

    Raises:
        DatasetError: see :func:`readable`.
    """
    tile_px = source.tile_px if tile_px is None else tile_px
    skipped: list[Skipped] = []
    tallies = {cores.name: Tally.of(cores) for cores in configurations}
    for name, pair in readable(source, skipped, strict=strict, watch=watch):
        refused: list[str] = []
        for cores in configurations:
            # The camera watch refuses the same tiles whatever the configuration.
            refused = _score(name, pair, cores, tile_px, tallies[cores.name], score_terms)
        if refused and strict:
            raise DatasetError(f'{name}: {refused[0]} (--strict)')
        if refused:
            skipped.append(Skipped(name, f'{len(refused)} tiles refused: {refused[0]}'))
    if not any(tally.frames for tally in tallies.values()):
        first = f'{skipped[0].name}: {skipped[0].reason}'
        raise DatasetError(
            f'{source.title}: no image could be scored; the first of {len(skipped)}: {first}'
        )
    return Outcome(source, tallies, tuple(skipped))


def _score(
    name: str, pair: Pair, cores: Cores, tile_px: int | None, tally: Tally, score_terms: bool
) -> list[str]:
    """Score an image; return why tiles of it got no heatmap."""
    image, labels = pair
    counts = np.zeros((LABELS, BINS), np.uint32)
    scored = tally.meanings.any(axis=1)
    terms = np.zeros((int(scored.sum()), 2, BINS), np.uint32)
    seconds, tiles = 0.0, 0
    refused: list[str] = []
    for look in looks(image, cores, tile_px, refused.append):
        own = look.tile.labels_of(labels)
        counts += count_labels(own, look.safety)
        seconds, tiles = seconds + look.seconds, tiles + 1
        tally.prompts[look.template] += 1
        if score_terms and len(terms):
            maps = cores.segmenter.term_maps(look.frame, cores.prompt(look.frame))
            height, width = maps.shape[1:]
            terms += count_terms(nearest(own, width, height), maps[scored], tally.meanings[scored])
    if not tiles:
        return refused
    tally.names.append(name)
    tally.counts.append(counts)
    tally.term_counts.append(terms)
    tally.tiles.append(tiles)
    tally.seconds.append(seconds)
    return refused
