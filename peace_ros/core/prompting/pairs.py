# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A prompt as key/value pairs: what the topic ``prompt`` carries, in flight and in a replay."""

from __future__ import annotations

from collections.abc import Mapping

from peace_ros.core.domain import ConfigurationError, Prompt, RankedWord

_TEMPLATE = 'template'
_BEST = 'best'
_SCORE = 'score'
_MOST_TEMPLATE, _MOST = 1_000, 65_536
"""Characters of a sentence, and of a whole prompt; more would cost time and memory in flight."""


def prompt_pairs(prompt: Prompt) -> dict[str, str]:
    """Return the pairs of a prompt.

    ``template``, and per category its best word (``best/environment``) and the score of each word
    (``score/environment/spring``), best first.
    """
    pairs = {_TEMPLATE: prompt.template}
    for category, ranking in prompt.ranking.items():
        pairs.update({f'{_BEST}/{category}': best.word for best in ranking[:1]})
        pairs.update({f'{_SCORE}/{category}/{each.word}': f'{each.score:.4f}' for each in ranking})
    return pairs


def prompt_from_pairs(pairs: Mapping[str, str], stamp_ns: int) -> Prompt:
    """Return the prompt of its pairs, made from the frame with that stamp.

    Raises:
        ConfigurationError: there is no template, a score is not a number, or it is too long.

    """
    if not pairs.get(_TEMPLATE):
        raise ConfigurationError(
            'prompt message without the key "template": connect the topic of a prompt_generator'
        )
    length = sum(len(key) + len(value) for key, value in pairs.items())
    if len(pairs[_TEMPLATE]) > _MOST_TEMPLATE or length > _MOST:
        raise ConfigurationError(
            f'prompt message of {length} characters, {len(pairs[_TEMPLATE])} of them in its '
            f'template: at most {_MOST} and {_MOST_TEMPLATE} are accepted'
        )
    ranking: dict[str, list[RankedWord]] = {}
    for key, value in pairs.items():
        kind, _, rest = key.partition('/')
        if kind == _SCORE:
            category, _, word = rest.partition('/')
            ranking.setdefault(category, []).append(RankedWord(word, _score(key, value)))
    return Prompt(pairs[_TEMPLATE], stamp_ns, {name: tuple(of) for name, of in ranking.items()})


def _score(key: str, value: str) -> float:
    try:
        return float(value)
    except ValueError as error:
        raise ConfigurationError(
            f'prompt message with {key} = {value!r}: a score is a number'
        ) from error
