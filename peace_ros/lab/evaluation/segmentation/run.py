# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Every labelled image through every configuration, once."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
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


@dataclass
class Tally:
    """What one configuration was found to do, frame by frame."""

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
    prompts: dict[str, int] = field(default_factory=dict)
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
    """What came out of a source."""

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


def looks(
    image_rgb: NDArray[np.uint8],
    cores: Cores,
    tile_px: int | None,
    refuse: Callable[[str], object] = lambda _: None,
) -> Iterator[TileLook]:
    """Yield what a configuration makes of each tile; ``refuse`` is told why there is none of one.

    A flight gets no heatmap of such a picture either.
    """
    height_px, width_px = image_rgb.shape[:2]
    for tile in tiles_of(height_px, width_px, tile_px):
        frame = Frame(np.ascontiguousarray(image_rgb[tile.rows, tile.columns]), 0)
        start = time.perf_counter()
        try:
            prompt = cores.prompt(frame)
            heatmap = cores.segment(frame, prompt)
        except ImageError as error:
            refuse(str(error))
            continue
        seconds = time.perf_counter() - start
        height, width = frame.image_rgb.shape[:2]
        safety = heatmap.safety
        if safety.shape != (height, width):
            safety = np.asarray(
                cv2.resize(safety, (width, height), interpolation=cv2.INTER_LINEAR), np.float32
            )
        yield TileLook(tile, safety, frame, prompt.template, seconds)


def evaluate(
    source: SampleSource,
    configurations: list[Cores],
    *,
    tile_px: int | None = None,
    strict: bool = False,
    score_terms: bool = True,
    report: Callable[[int], None] | None = None,
) -> Outcome:
    """Run every configuration over every image of a source.

    Args:
        source: labelled images.
        configurations: at least one.
        tile_px: see :func:`tiles_of`; None also takes what the source suggests.
        strict: refuse the first image that cannot be scored instead of skipping it.
        score_terms: also score each term by itself; each frame is then encoded twice.
        report: is called with the number of images that are done.

    Raises:
        DatasetError: nothing could be scored, or ``strict`` and something could not.
    """
    tile_px = source.tile_px if tile_px is None else tile_px
    skipped = list(source.skipped)
    if strict and skipped:
        raise DatasetError(f'{skipped[0].name}: {skipped[0].reason} (--strict)')
    tallies = {cores.name: Tally.of(cores) for cores in configurations}
    for done, sample in enumerate(source.samples, start=1):
        pair = _load(sample, skipped, strict=strict)
        if pair is not None:
            for cores in configurations:
                tally = tallies[cores.name]
                refused = _score(sample.name, pair, cores, tile_px, tally, score_terms)
            # The camera watch refuses the same tiles whatever the configuration.
            if refused and strict:
                raise DatasetError(f'{sample.name}: {refused[0]} (--strict)')
            if refused:
                skipped.append(Skipped(sample.name, f'{len(refused)} tiles refused: {refused[0]}'))
        if report is not None:
            report(done)
    if not any(tally.frames for tally in tallies.values()):
        reason = f'; the first of {len(skipped)}: {skipped[0].name}: {skipped[0].reason}'
        raise DatasetError(f'{source.title}: no image could be scored{reason if skipped else ""}')
    return Outcome(source, tallies, tuple(skipped))


def _load(sample: Sample, skipped: list[Skipped], *, strict: bool) -> Pair | None:
    try:
        return sample.load()
    except SampleError as error:
        if strict:
            raise DatasetError(f'{sample.name}: {error} (--strict)') from error
        skipped.append(Skipped(sample.name, str(error)))
        return None


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
        tally.prompts[look.template] = tally.prompts.get(look.template, 0) + 1
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
