# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Text -> token numbers; says what was cut off, and which words the model does not know."""

from __future__ import annotations

import html
import logging
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import ftfy
import numpy as np
import tokenizers
from numpy.typing import NDArray

from peace_ros.core.domain import BundleError, ConfigurationError

END_OF_WORD = '</w>'
"""How CLIP's byte-pair encoding marks the end of a word; no other tokenizer here does."""

_LOG = logging.getLogger(__name__)


@dataclass(frozen=True)
class Tokens:
    """A batch of B texts, padded to the longest of them (L tokens)."""

    input_ids: NDArray[np.int64]
    """[B, L]."""
    attention_mask: NDArray[np.int64]
    """[B, L], 1 for a token, 0 for padding."""


class Tokenizer:
    """The bundle's tokenizer.json."""

    def __init__(self, path: Path, context_length: int) -> None:
        """Read the file; raises BundleError when it is not a tokenizer."""
        try:
            self._tokenizer = tokenizers.Tokenizer.from_file(str(path))
        except Exception as error:  # the library raises the base class and nothing narrower
            raise BundleError(
                f'{path}: not a tokenizer ({error}); fetch or build the bundle again'
            ) from error
        self.context_length = context_length
        padding: dict[str, Any] = dict(self._tokenizer.padding or {})
        self._tokenizer.enable_padding(
            pad_id=padding.get('pad_id', 0), pad_token=padding.get('pad_token', '[PAD]')
        )
        self._tokenizer.enable_truncation(context_length)
        model = self._tokenizer.model
        unknown = getattr(model, 'unk_token', None)
        self._unknown_id = None if unknown is None else self._tokenizer.token_to_id(unknown)
        self._cleans = getattr(model, 'end_of_word_suffix', None) == END_OF_WORD
        self._reported: set[str] = set()

    def __call__(self, texts: Sequence[str]) -> Tokens:
        """Encode texts; one that is too long is cut off, with a warning once.

        Raises ConfigurationError for an empty list or a blank text.
        """
        if not texts or not all(text.strip() for text in texts):
            raise ConfigurationError(f'texts to encode {list(texts)}: give non-blank texts')
        cleaned = map(clean_for_clip, texts) if self._cleans else texts
        encodings = self._tokenizer.encode_batch(list(cleaned))
        for text, encoding in zip(texts, encodings, strict=True):
            if encoding.overflowing and text not in self._reported:
                self._reported.add(text)
                _LOG.warning(
                    'text %r is longer than the %d tokens that the model takes; its end is '
                    'ignored, shorten it',
                    text,
                    self.context_length,
                )
        return Tokens(
            np.array([each.ids for each in encodings], np.int64),
            np.array([each.attention_mask for each in encodings], np.int64),
        )

    def unknown_words(self, text: str) -> tuple[str, ...]:
        """Return the words of a text that the model has never learned, as they are written.

        Empty for tokenizers that spell unknown words out in smaller pieces.
        """
        if self._unknown_id is None or self._cleans:
            return ()
        encoding = self._tokenizer.encode(text)
        spans = list(zip(encoding.ids, encoding.offsets, strict=True))
        found = [text[start:end] for token, (start, end) in spans if token == self._unknown_id]
        # A script that the model does not know at all leaves no token.
        found += [
            word[0]
            for word in re.finditer(r'\w+', text)
            if not any(start < word.end() and word.start() < end for _, (start, end) in spans)
        ]
        return tuple(dict.fromkeys(found))


def clean_for_clip(text: str) -> str:
    """Return a text as OpenAI's CLIP cleans it before it splits it into words.

    Broken encodings, curly quotes and HTML entities are undone, white space becomes single
    blanks, capitals small.
    """
    fixed = html.unescape(html.unescape(ftfy.fix_text(text)))
    return re.sub(r'\s+', ' ', fixed).strip().lower()
