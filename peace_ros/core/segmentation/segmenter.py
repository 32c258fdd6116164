# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What every open-vocabulary segmenter can do, and what those over a bundle share."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from copy import copy
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import BundleError, ConfigurationError, Frame, Heatmap, Prompt
from peace_ros.core.domain.parameters import ParameterSet, parameter
from peace_ros.core.inference import Bundle, TextEncoder, open_sessions
from peace_ros.core.inference.manifest import THRESHOLDS
from peace_ros.core.inference.providers import Footprint, LoadMeter
from peace_ros.core.segmentation.fusion import FUSIONS
from peace_ros.core.segmentation.terms import Terms

BundleOrName = Bundle | Path | str
"""A bundle that is loaded, or the folder or name of one."""


@dataclass(frozen=True)
class SegmentationParameters(ParameterSet):
    """Parameters of the segmentation, whatever the family of its model."""

    family: str = parameter('clipseg', 'Family of the segmentation model: clipseg or fastsam')
    bundle: str = parameter(
        'clipseg-small', 'Model bundle of that family: a folder or the name of a shipped one'
    )
    terms: str = parameter(
        'terms.yaml', 'YAML file of the terms: a path or the name of a shipped one', live=True
    )
    fusion: str = parameter(
        'set_difference',
        'How terms become one score: set_difference min(Sp, 1 - Sn), soft Sp * (1 - Sn), '
        'softmax over all terms',
        choices=tuple(FUSIONS),
    )
    threads: int = parameter(2, 'CPU threads of the networks', low=1, high=64)
    providers: tuple[str, ...] = parameter(
        ('CPUExecutionProvider',), 'ONNX Runtime execution providers, the preferred one first'
    )
    cache_dir: str = parameter(
        '', 'Folder that keeps text embeddings for the next start; empty keeps them in memory only'
    )


class Segmenter(Protocol):
    """Frame + Prompt -> Heatmap; a subclass needs :attr:`terms` and :meth:`segment`.

    Models of a family are made with (bundle, terms, parameters, parameters of the family); see
    ``registry.py``.
    """

    terms: Terms
    """What it looks for."""
    footprint: Footprint | None = None
    """What its networks run on and take; None where that was not measured."""
    threshold: float = 0.5
    """The network's own score that stands at one half of the heatmap, between 0 and 1."""

    @property
    def unknown_terms(self) -> Mapping[str, tuple[str, ...]]:
        """Term -> its words that the model has never learned; it cannot see those."""
        return {}

    @property
    def calls(self) -> Mapping[str, int]:
        """Role of a network -> how often it ran, without warm-ups."""
        return {}

    def prepare(self, prompt: Prompt) -> None:
        """Embed the prompt's texts ahead of the frame; may be called from another thread."""

    def with_terms(self, terms: Terms) -> Segmenter:  # noqa: ARG002
        """Return a segmenter over the same networks that looks for other terms."""
        raise ConfigurationError(
            f'{type(self).__name__} cannot change its terms: start the node again with them'
        )

    def segment(self, frame: Frame, prompt: Prompt) -> Heatmap:
        """Return the safety of each pixel, with the frame's stamp.

        Raises ImageError for an image that cannot be used, BundleError for an answer of the
        network that cannot be used.
        """

    def term_maps(self, frame: Frame, prompt: Prompt) -> NDArray[np.float32]:  # noqa: ARG002
        """Return one map per term, [T, h, w] float32 0 to 1, in the order of ``terms.all``."""
        raise ConfigurationError(
            f'{type(self).__name__} does not score each term by itself: choose another family'
        )


class BundleSegmenter(Segmenter):
    """What the segmenters over a bundle share: networks, texts and the fusion of terms."""

    FAMILY: ClassVar[str]
    ROLES: ClassVar[tuple[str, ...]]
    """Of the bundle's networks."""
    MEASURED_WITH: ClassVar[str]
    """The fusion for which the threshold that a bundle recommends was measured."""

    def __init__(
        self,
        bundle: BundleOrName,
        terms: Terms,
        parameters: SegmentationParameters,
        own: Any = None,
    ) -> None:
        """Open the bundle's graphs and run them once.

        Args:
            bundle: of the family.
            terms: what to look for.
            parameters: of the segmentation; its bundle and terms are those given here.
            own: of the family; None: as they are declared.

        Raises:
            BundleError: the bundle is of another family or its graphs do not fit it.
            ConfigurationError: an execution provider is not available, or the terms do not fit
                the family or the fusion.
        """
        self._check_terms(terms, parameters)
        self._parameters = parameters
        loaded = bundle if isinstance(bundle, Bundle) else Bundle.load(bundle)
        loaded.require_family(self.FAMILY)
        meter = LoadMeter()
        self._manifest = loaded.manifest
        self.terms = terms
        self._fusion = FUSIONS[parameters.fusion]
        if parameters.fusion == self.MEASURED_WITH:
            self.threshold = _recommended_threshold(loaded)
        self._sessions = open_sessions(
            loaded, self.ROLES, threads=parameters.threads, providers=parameters.providers
        )
        cache_dir = Path(parameters.cache_dir).expanduser() if parameters.cache_dir else None
        self._text = TextEncoder(loaded, self._sessions['text_encoder'], cache_dir)
        self._warm_up(own)
        providers = [each for session in self._sessions.values() for each in session.providers]
        self.footprint = meter.read(
            loaded.manifest.name,
            loaded.manifest.precision,
            tuple(dict.fromkeys(providers)),
            parameters.threads,
        )

    @abstractmethod
    def _check_terms(self, terms: Terms, parameters: SegmentationParameters) -> None:
        """Raise ConfigurationError when the scores of these terms would mean nothing."""

    @abstractmethod
    def _warm_up(self, own: Any) -> None:
        """Run each network once, so that no frame waits for memory; own: as it was given."""

    @property
    def unknown_terms(self) -> Mapping[str, tuple[str, ...]]:
        """Term -> its words that the model has never learned; it cannot see those."""
        return self._text.unknown_words(self.terms.all)

    @property
    def calls(self) -> Mapping[str, int]:
        """Role of a network -> how often it ran, without warm-ups."""
        return {role: session.calls for role, session in self._sessions.items()}

    def with_terms(self, terms: Terms) -> BundleSegmenter:
        """Return a segmenter over the same networks that looks for other terms.

        Raises:
            ConfigurationError: they do not fit the family or the fusion.
        """
        self._check_terms(terms, self._parameters)
        other = copy(self)
        other.terms = terms
        return other

    def prepare(self, prompt: Prompt) -> None:
        """Embed the prompt's texts ahead of the frame; may be called from another thread."""
        self._embeddings(prompt)

    def _embeddings(self, prompt: Prompt) -> NDArray[np.float32]:
        return self._text([prompt.text_for(term) for term in self.terms.all])

    def _unusable(self, role: str, what: str) -> BundleError:
        path = self._sessions[role].graph.path
        return BundleError(
            f'{path}: gave {what}, which cannot be used; the frame gets no heatmap, choose '
            'another bundle if this stays'
        )


def _recommended_threshold(bundle: Bundle) -> float:
    threshold = float(bundle.manifest.recommended.get('threshold', 0.5))
    low, high = THRESHOLDS
    if not low <= threshold <= high:
        raise BundleError(
            f'{bundle.folder / "manifest.json"}: recommended threshold {threshold} must lie '
            f'between {low} and {high}: correct the manifest or export the bundle again'
        )
    return threshold
