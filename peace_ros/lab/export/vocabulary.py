# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""CLIP's byte-pair vocabulary and the tokenizer.json made of it."""

from __future__ import annotations

import importlib.util
import runpy
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tokenizers
from tokenizers import models, pre_tokenizers, processors

from peace_ros.core.domain import BundleError
from peace_ros.core.inference.tokenizer import END_OF_WORD

START_OF_TEXT, END_OF_TEXT = '<|startoftext|>', '<|endoftext|>'
_WORDS = (
    r"(?i)<\|startoftext\|>|<\|endoftext\|>|'s|'t|'re|'ve|'m|'ll|'d|[\p{L}]+|[\p{N}]"
    r'|[^\s\p{L}\p{N}]+'
)
_SHIPPED_BY = 'clip'


@dataclass(frozen=True)
class Vocabulary:
    """Token -> number, and the merges in their order."""

    tokens: Mapping[str, int]
    merges: tuple[tuple[str, str], ...]

    @classmethod
    def from_bpe(cls, tokens: Mapping[str, int], merges: Iterable[Any]) -> Vocabulary:
        """Take both from a tokenizer.json; raises BundleError when they are not CLIP's."""
        pairs = tuple(
            (str(first), str(second))
            for first, second in (
                each.split(' ') if isinstance(each, str) else each for each in merges
            )
        )
        if START_OF_TEXT not in tokens or END_OF_TEXT not in tokens:
            raise BundleError(
                f'tokenizer without {START_OF_TEXT} and {END_OF_TEXT}: give a checkpoint with '
                "CLIP's own tokenizer"
            )
        return cls(dict(tokens), pairs)

    @property
    def end_of_text(self) -> int:
        """Number of the token that ends every text."""
        return self.tokens[END_OF_TEXT]

    def write(self, path: Path, context_length: int) -> None:
        """Write tokenizer.json. Text is cleaned by the runtime, so it holds no normaliser."""
        tokenizer = tokenizers.Tokenizer(
            models.BPE(
                vocab=dict(self.tokens),
                merges=list(self.merges),
                continuing_subword_prefix='',
                end_of_word_suffix=END_OF_WORD,
            )
        )
        tokenizer.pre_tokenizer = pre_tokenizers.Sequence(
            [
                pre_tokenizers.Split(tokenizers.Regex(_WORDS), behavior='removed', invert=True),
                pre_tokenizers.ByteLevel(add_prefix_space=False, use_regex=False),
            ]
        )
        start, end = (START_OF_TEXT, self.tokens[START_OF_TEXT]), (END_OF_TEXT, self.end_of_text)
        tokenizer.post_processor = processors.RobertaProcessing(
            end, start, trim_offsets=False, add_prefix_space=False
        )
        tokenizer.add_special_tokens([START_OF_TEXT, END_OF_TEXT])
        tokenizer.enable_padding(pad_id=self.end_of_text, pad_token=END_OF_TEXT)
        tokenizer.enable_truncation(context_length)
        # Its own save raises no OSError when a disk is full.
        path.write_text(tokenizer.to_str(pretty=True), encoding='utf-8')


def shipped_vocabulary() -> Vocabulary:
    """Return OpenAI's vocabulary from the installed package openai-clip; raises BundleError."""
    spec = importlib.util.find_spec(_SHIPPED_BY)
    file = Path(spec.origin).with_name('simple_tokenizer.py') if spec and spec.origin else None
    if file is None or not file.is_file():
        raise BundleError(
            'the checkpoint has no tokenizer and the package with that of CLIP is not installed: '
            'run pip install openai-clip'
        )
    # Not imported as a part of its package, which needs torchvision.
    tokenizer = runpy.run_path(str(file))['SimpleTokenizer']()
    return Vocabulary(tokenizer.encoder, tuple(tokenizer.bpe_ranks))
