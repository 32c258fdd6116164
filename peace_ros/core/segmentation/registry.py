# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Families of segmentation models and how each is made."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType

from peace_ros.core.domain import ConfigurationError
from peace_ros.core.inference import Bundle
from peace_ros.core.segmentation.clipseg import ClipSegSegmenter
from peace_ros.core.segmentation.fastsam import FastSamSegmenter
from peace_ros.core.segmentation.segmenter import SegmentationParameters, Segmenter
from peace_ros.core.segmentation.terms import Terms

BundleOrName = Bundle | Path | str
Factory = Callable[[BundleOrName, Terms, SegmentationParameters], Segmenter]


def _clipseg(bundle: BundleOrName, terms: Terms, parameters: SegmentationParameters) -> Segmenter:
    loaded = bundle if isinstance(bundle, Bundle) else Bundle.load(bundle)
    return ClipSegSegmenter(loaded, terms, parameters)


def _fastsam(bundle: BundleOrName, terms: Terms, parameters: SegmentationParameters) -> Segmenter:
    loaded = bundle if isinstance(bundle, Bundle) else Bundle.load(bundle)
    return FastSamSegmenter(loaded, terms, parameters)


FACTORIES: Mapping[str, Factory] = MappingProxyType({'clipseg': _clipseg, 'fastsam': _fastsam})


def create_segmenter(
    family: str, bundle: BundleOrName, terms: Terms, parameters: SegmentationParameters
) -> Segmenter:
    """Make the segmenter of a family.

    Args:
        family: a key of FACTORIES.
        bundle: loaded, or the folder or name of one.
        terms: what to look for.
        parameters: of the segmentation.

    Raises:
        ConfigurationError: the family is unknown or the parameters do not fit it.
        BundleError: the bundle cannot be used.
    """
    factory = FACTORIES.get(family)
    if factory is None:
        raise ConfigurationError(
            f'segmentation family {family!r} is unknown: choose one of {", ".join(FACTORIES)}'
        )
    return factory(bundle, terms, parameters)
