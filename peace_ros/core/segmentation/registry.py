# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The families of segmentation models: one entry makes a family known to everything else."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

from peace_ros.core.domain import ConfigurationError
from peace_ros.core.segmentation.clipseg import ClipSegParameters, ClipSegSegmenter
from peace_ros.core.segmentation.fastsam import FastSamParameters, FastSamSegmenter
from peace_ros.core.segmentation.segmenter import BundleOrName, SegmentationParameters, Segmenter
from peace_ros.core.segmentation.terms import Terms, load_terms

_LOG = logging.getLogger(__name__)


class Log(Protocol):
    """A logger of Python or of a node."""

    def info(self, message: str, /) -> object:
        """Tell a fact."""

    def warning(self, message: str, /) -> object:
        """Tell what someone should change."""


@dataclass(frozen=True)
class Family:
    """A kind of segmentation model."""

    create: Callable[[BundleOrName, Terms, SegmentationParameters, Any], Segmenter]
    """Its class; the last argument is an instance of its own parameters."""
    parameters: type[Any]
    """Dataclass of its own parameters, which become parameters of the segmentation node."""


FAMILIES: dict[str, Family] = {
    'clipseg': Family(ClipSegSegmenter, ClipSegParameters),
    'fastsam': Family(FastSamSegmenter, FastSamParameters),
}
"""Name (parameter ``family``) -> family; docs/examples/custom_segmenter.py adds one."""


def family_of(parameters: SegmentationParameters) -> Family:
    """Return the family that is chosen.

    Raises:
        ConfigurationError: it does not exist.
    """
    family = FAMILIES.get(parameters.family)
    if family is None:
        raise ConfigurationError(
            f'segmentation family {parameters.family!r} is unknown: choose one of '
            f'{", ".join(FAMILIES)}'
        )
    return family


def create_segmenter(
    parameters: SegmentationParameters,
    own: Any = None,
    *,
    bundle: BundleOrName | None = None,
    terms: Terms | None = None,
    log: Log = _LOG,
) -> Segmenter:
    """Make the segmenter of the family that is chosen, and warn of terms that it cannot see.

    Args:
        parameters: of the segmentation.
        own: of the family; None: as they are declared.
        bundle: in place of the one that the parameters name.
        terms: likewise.
        log: gets a line about the model and a warning for each such term.

    Raises:
        ConfigurationError: the family is unknown or the parameters do not fit it.
        BundleError: the bundle cannot be used.
    """
    family = family_of(parameters)
    segmenter = family.create(
        bundle or parameters.bundle,
        load_terms(parameters.terms) if terms is None else terms,
        parameters,
        family.parameters() if own is None else own,
    )
    log.info(f'model: {segmenter.footprint or type(segmenter).__name__}')
    for term, words in segmenter.unknown_terms.items():
        log.warning(
            f'term {term!r}: the model has never learned {", ".join(words)} and cannot see it'
        )
    return segmenter
