# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""CLIP's byte-pair vocabulary and the tokenizer.json made of it."""

from __future__ import annotations

import gzip
import importlib.util
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import tokenizers
from tokenizers import models, pre_tokenizers, processors

from peace_ros.core.domain import BundleError
from peace_ros.core.inference.tokenizer import END_OF_WORD

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

START_OF_TEXT, END_OF_TEXT = '<|startoftext|>', '<|endoftext|>'
_WORDS = (
    r"(?i)<\|startoftext\|>|<\|endoftext\|>|'s|'t|'re|'ve|'m|'ll|'d|[\p{L}]+|[\p{N}]"
    r'|[^\s\p{L}\p{N}]+'
)
_MERGES_IN_USE = 49152 - 256 - 2
_SHIPPED_BY, _FILE = ('clip', 'open_clip'), 'bpe_simple_vocab_16e6.txt.gz'
"""Packages that bring OpenAI's file of merges: openai-clip (of the extra), and OpenCLIP."""


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
    """Read OpenAI's vocabulary from an installed package; raises BundleError."""
    specs = [importlib.util.find_spec(name) for name in _SHIPPED_BY]
    folders = [each for spec in specs if spec for each in spec.submodule_search_locations or ()]
    file = next((Path(each) / _FILE for each in folders if (Path(each) / _FILE).is_file()), None)
    if file is None:
        raise BundleError(
            f'the checkpoint has no tokenizer and {_FILE} is not installed: '
            'run pip install openai-clip'
        )
    return read_vocabulary(file)


def read_vocabulary(file: Path) -> Vocabulary:
    """Read OpenAI's list of merges, gzip text with one line of heading."""
    lines = gzip.decompress(file.read_bytes()).decode('utf-8').split('\n')
    merges = []
    for line in lines[1 : _MERGES_IN_USE + 1]:
        first, second = line.split()
        merges.append((first, second))
    letters = _byte_letters()
    words = [
        *letters,
        *(letter + END_OF_WORD for letter in letters),
        *(first + second for first, second in merges),
        START_OF_TEXT,
        END_OF_TEXT,
    ]
    return Vocabulary({word: index for index, word in enumerate(words)}, tuple(merges))


def _byte_letters() -> list[str]:
    """Return the letter that stands for each byte: printable ones first, as GPT-2 laid down."""
    printable = [*range(33, 127), *range(161, 173), *range(174, 256)]
    others = [byte for byte in range(256) if byte not in printable]
    return [chr(byte) for byte in printable] + [chr(256 + index) for index in range(len(others))]
