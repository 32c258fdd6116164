# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Frame -> Prompt: the words that fit the image best, put into the template."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import ConfigurationError, Frame, Prompt, RankedWord
from peace_ros.core.domain.parameters import ParameterSet, parameter
from peace_ros.core.prompting.templates import categories_of, resolve_template
from peace_ros.core.prompting.vocabulary import Vocabularies


class Encoder(Protocol):
    """Anything that puts images and texts into one space of unit vectors."""

    def image_embedding(self, frame: Frame) -> NDArray[np.float32]:
        """Return (D,) float32 of unit length."""

    def text_embeddings(self, texts: Sequence[str]) -> NDArray[np.float32]:
        """Return (T, D) float32 of unit length."""


@dataclass(frozen=True)
class PromptingParameters(ParameterSet):
    """Parameters of the prompt generator."""

    template: str = parameter(
        'PEACE',
        'DD, D or PEACE, or a sentence with {term} and any of {resolution}, {frame}, {environment}',
        live=True,
    )
    vocabularies: str = parameter(
        'vocabularies.yaml',
        'YAML file of the vocabularies: a path or the name of a shipped one',
        live=True,
    )
    bundle: str = parameter(
        'clip-small', 'Model bundle of the family clip: a folder or the name of a shipped one'
    )
    environment_words: int = parameter(
        1, 'Best environment words that a prompt names, joined by commas', low=1, high=10, live=True
    )
    margin: float = parameter(
        0.01,
        'Lead in cosine similarity with which a new word replaces the one in use; 0 follows '
        'every frame',
        low=0.0,
        high=2.0,
        live=True,
    )
    smoothing: float = parameter(
        0.0,
        'Weight of the frames before in the similarities, per frame; 0 looks at the newest alone',
        low=0.0,
        high=0.99,
        live=True,
    )
    interval_s: float = parameter(
        0.0,
        'Shortest time between two rankings, by the stamps of the frames; those in between keep '
        'the prompt. 0 ranks every frame; a full-size CLIP on a CPU wants 2',
        unit='s',
        low=0.0,
        high=60.0,
        live=True,
    )
    threads: int = parameter(2, 'CPU threads of the networks', low=1, high=64)
    providers: tuple[str, ...] = parameter(
        ('CPUExecutionProvider',), 'ONNX Runtime execution providers, the preferred one first'
    )
    cache_dir: str = parameter(
        '', 'Folder that keeps text embeddings for the next start; empty keeps them in memory only'
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        resolve_template(self.template)

    @property
    def is_static(self) -> bool:
        """The template has no vocabulary words: every frame gets the same prompt."""
        return not categories_of(resolve_template(self.template))


class _Category:
    """The words of one category: their embeddings, smoothed similarities and the ones in use."""

    def __init__(self, words: tuple[str, ...], embeddings: NDArray[np.float32], count: int) -> None:
        self.words = words
        self._embeddings = embeddings
        self._count = min(count, len(words))
        self.reset()

    def reset(self) -> None:
        self._smoothed: NDArray[np.float32] | None = None
        self._chosen: list[int] = []

    def look(self, image: NDArray[np.float32], smoothing: float) -> NDArray[np.float32]:
        """Take in one frame; return the smoothed cosine similarity of each word."""
        scores = np.asarray(self._embeddings @ image, np.float32)
        if self._smoothed is not None:
            scores = smoothing * self._smoothed + np.float32(1.0 - smoothing) * scores
        self._smoothed = scores
        return scores

    def choose(self, scores: NDArray[np.float32], margin: float) -> list[str]:
        """Return the words to use; one in use stays until another is ahead by the margin."""
        held = scores.astype(np.float64)
        held[self._chosen] += margin
        best = [int(index) for index in np.argsort(-held, kind='stable')[: self._count]]
        # A newcomer takes the place of the word it replaces: mere changes of order among the
        # words in use would make a new prompt of the same meaning.
        newcomers = [index for index in best if index not in self._chosen]
        kept = [index if index in best else newcomers.pop(0) for index in self._chosen]
        self._chosen = kept + newcomers
        return [self.words[index] for index in self._chosen]


class PromptGenerator:
    """Ranks the vocabularies against each frame and writes the prompt.

    The words go to the encoder bare, as the CLIP interrogator puts them. Their embeddings are
    computed once, here; a frame then costs one image encoding, and nothing at all when the
    template is static.
    """

    def __init__(
        self,
        encoder: Encoder | None,
        vocabularies: Vocabularies | None,
        parameters: PromptingParameters,
    ) -> None:
        """Encode the words of the categories that the template asks for.

        Args:
            encoder: may be None for a static template.
            vocabularies: may be None for a static template.
            parameters: of the prompt generator.

        Raises:
            ConfigurationError: the template needs an encoder or vocabularies and has none.
        """
        self._parameters = parameters
        self._sentence = resolve_template(parameters.template)
        self.encoder = encoder
        """Puts frames and words into one space; None with a static template."""
        self._categories: dict[str, _Category] = {}
        self._newest_stamp_ns: int | None = None
        self._ranked: Prompt | None = None
        """The prompt of the last frame that was ranked."""
        names = categories_of(self._sentence)
        if not names:
            return
        if encoder is None or vocabularies is None:
            raise ConfigurationError(
                f'prompt template {self._sentence!r} asks for words but there is no encoder or '
                'no vocabularies; give both or use a static template (DD, D)'
            )
        words = [vocabularies.words(name) for name in names]
        embeddings = encoder.text_embeddings([word for each in words for word in each])
        parts = np.split(embeddings, np.cumsum([len(each) for each in words])[:-1])
        for name, own, rows in zip(names, words, parts, strict=True):
            count = parameters.environment_words if name == 'environment' else 1
            self._categories[name] = _Category(own, rows, count)

    def reset(self) -> None:
        """Forget the frames so far; the next one is ranked on its own."""
        self._newest_stamp_ns = None
        self._ranked = None
        for category in self._categories.values():
            category.reset()

    def generate(self, frame: Frame) -> Prompt:
        """Return the prompt for a frame, with its stamp and the similarity of every word.

        Between two rankings (parameter ``interval_s``) it is the last one's, words and scores
        alike. A stamp before that of the last frame begins a new sequence. Raises ImageError when
        the encoder cannot take the image, BundleError when its answer cannot be used.
        """
        if self.encoder is None or not self._categories:
            return Prompt(self._sentence, frame.stamp_ns)
        if self._newest_stamp_ns is not None and frame.stamp_ns < self._newest_stamp_ns:
            self.reset()
        self._newest_stamp_ns = frame.stamp_ns
        interval_ns = self._parameters.interval_s * 1e9
        if self._ranked is not None and frame.stamp_ns < self._ranked.stamp_ns + interval_ns:
            return Prompt(self._ranked.template, frame.stamp_ns, self._ranked.ranking)
        self._ranked = self._rank(self.encoder, frame)
        return self._ranked

    def _rank(self, encoder: Encoder, frame: Frame) -> Prompt:
        image = encoder.image_embedding(frame)
        sentence = self._sentence
        ranking = {}
        for name, category in self._categories.items():
            scores = category.look(image, self._parameters.smoothing)
            words = category.choose(scores, self._parameters.margin)
            sentence = sentence.replace('{' + name + '}', ', '.join(words))
            ranking[name] = _ranked(category.words, scores)
        return Prompt(sentence, frame.stamp_ns, ranking)


def _ranked(words: tuple[str, ...], scores: NDArray[np.float32]) -> tuple[RankedWord, ...]:
    order = np.argsort(-scores, kind='stable')
    return tuple(RankedWord(words[index], float(scores[index])) for index in order)
