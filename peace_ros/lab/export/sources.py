# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where a model comes from: a Hugging Face id, a local folder, or an OpenAI/OpenCLIP checkpoint."""

from __future__ import annotations

import errno
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from transformers import AutoConfig, AutoTokenizer, CLIPModel, CLIPSegForImageSegmentation
from transformers import logging as transformers_logging

from peace_ros.core.domain import BundleError
from peace_ros.core.inference.manifest import InputSpec
from peace_ros.lab.export.openclip import SUFFIXES, is_openclip, load_openclip
from peace_ros.lab.export.vocabulary import Vocabulary, shipped_vocabulary

_CLASSES = {'clip': CLIPModel, 'clipseg': CLIPSegForImageSegmentation}
_OPENAI_MEAN = (0.48145466, 0.4578275, 0.40821073)
_OPENAI_STD = (0.26862954, 0.26130258, 0.27577711)
_IMAGENET_MEAN, _IMAGENET_STD = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)
_CLIPSEG_SIDE_PX = 352
_RESAMPLE = {2: 'bilinear', 3: 'bicubic'}
"""Pillow's numbers, as preprocessor_config.json gives them."""
_PREPROCESSOR = 'preprocessor_config.json'


@dataclass(frozen=True)
class ModelSource:
    """A reference model in memory, with all that its bundle needs."""

    name: str
    family: str
    model: Any
    """``CLIPModel`` or ``CLIPSegForImageSegmentation`` of transformers, in evaluation mode."""
    vocabulary: Vocabulary
    input: InputSpec
    context_length: int

    @property
    def embedding_width(self) -> int:
        """Length of an embedding."""
        return int(self.model.config.projection_dim)


def load_source(source: str) -> ModelSource:
    """Load a model.

    Args:
        source: a Hugging Face id (``CIDAS/clipseg-rd64-refined``), a folder as
            ``save_pretrained`` writes it, or an OpenAI or OpenCLIP checkpoint of CLIP (a file, or
            a folder with ``open_clip_config.json``).

    Raises:
        BundleError: it is not there, cannot be downloaded, is of another family, or its weights
            do not fill the network.
    """
    path = Path(source).expanduser()
    if path.exists() and is_openclip(path):
        model = load_openclip(path)
        side = int(model.config.vision_config.image_size)
        spec = default_input('clip', side)
        return _source(path.stem, 'clip', model, _usual_vocabulary(source, model), spec)
    _check_place(source, path)
    # Unlike a shell, transformers knows no ~.
    source = str(path) if path.is_dir() else source
    transformers_logging.set_verbosity_error()
    family = _family(source)
    model = _load_weights(source, family)
    spec = _input(source, path, family, model)
    return _source(Path(source).name, family, model, _vocabulary(source, path, model), spec)


def from_model(name: str, family: str, model: Any) -> ModelSource:
    """Wrap a model that is already in memory, with its family's usual preprocessing."""
    side = _CLIPSEG_SIDE_PX if family == 'clipseg' else int(model.config.vision_config.image_size)
    return _source(name, family, model, shipped_vocabulary(), default_input(family, side))


def default_input(family: str, side_px: int) -> InputSpec:
    """Return the family's published preprocessing."""
    if family == 'clipseg':
        return InputSpec(side_px, side_px, 'stretch', _IMAGENET_MEAN, _IMAGENET_STD, 'bilinear')
    return InputSpec(side_px, side_px, 'crop', _OPENAI_MEAN, _OPENAI_STD, 'bicubic')


def _source(
    name: str, family: str, model: Any, vocabulary: Vocabulary, spec: InputSpec
) -> ModelSource:
    context_length = int(model.config.text_config.max_position_embeddings)
    return ModelSource(name, family, model.eval(), vocabulary, spec, context_length)


def _check_place(source: str, path: Path) -> None:
    """Refuse what transformers would take for the name of a repository, or for a configuration."""
    if path.is_dir():
        if not (path / 'config.json').is_file():
            raise BundleError(
                f'{source}: no config.json in it; give a folder with config.json and the weights, '
                'as save_pretrained writes it, or one with open_clip_config.json'
            )
    elif path.exists():
        raise BundleError(
            f'{source}: no checkpoint by its name; give a file that ends in {", ".join(SUFFIXES)}, '
            'a folder or a Hugging Face id'
        )
    elif source.startswith(('.', '/', '~')) or source.count('/') > 1 or path.suffix in SUFFIXES:
        raise BundleError(f'{source}: no such file or folder; check the path')


def _family(source: str) -> str:
    try:
        family = str(AutoConfig.from_pretrained(source).model_type)
    except (OSError, ValueError, KeyError) as error:
        remedy = (
            'download its config.json again, or give the folder of a CLIP or CLIPSeg'
            if Path(source).is_dir()
            else 'check the name and the network, or give a folder with config.json and the weights'
        )
        raise BundleError(
            f'{source}: no model configuration could be read ({_first_sentence(error)}); {remedy}'
        ) from error
    if family not in _CLASSES:
        raise BundleError(
            f'{source}: a checkpoint of the family {family!r}; this exporter takes '
            f'{" and ".join(_CLASSES)}'
        )
    return family


def _load_weights(source: str, family: str) -> Any:
    try:
        model, report = _CLASSES[family].from_pretrained(
            source,
            output_loading_info=True,
            attn_implementation='sdpa',
            ignore_mismatched_sizes=True,  # they are in the report
        )
    except Exception as error:  # safetensors, pickle and the hub have no common base
        is_full = isinstance(error, OSError) and error.errno == errno.ENOSPC
        remedy = 'free some space' if is_full else 'download them again'
        raise BundleError(
            f'{source}: its weights cannot be read ({_first_sentence(error)}); {remedy}'
        ) from error
    missing = sorted(key for key in report['missing_keys'] if not key.endswith('position_ids'))
    odd = sorted(str(name) for name, *_ in report.get('mismatched_keys', ()))
    if missing or odd:
        examples = ', '.join((missing + odd)[:3])
        raise BundleError(
            f'{source}: {len(missing)} weights are missing and {len(odd)} are of another shape '
            f'({examples}, ...); the checkpoint is damaged or of another family'
        )
    return model


def _vocabulary(source: str, path: Path, model: Any) -> Vocabulary:
    """Read the source's own; those without tokenizer files share OpenAI's."""
    for file in (path / 'tokenizer.json', path / 'vocab.json'):
        # What cannot be read transformers takes for missing.
        if file.is_file():
            _read_json(file)
    try:
        tokenizer = AutoTokenizer.from_pretrained(source)
        parts = json.loads(tokenizer.backend_tokenizer.to_str())['model']
    except (OSError, ValueError, KeyError, AttributeError):
        return _usual_vocabulary(source, model)
    # Where the files are missing, transformers makes up a tokenizer of three tokens.
    if len(parts['vocab']) != model.config.text_config.vocab_size:
        return _usual_vocabulary(source, model)
    return Vocabulary.from_bpe(parts['vocab'], parts['merges'])


def _usual_vocabulary(source: str, model: Any) -> Vocabulary:
    """Return OpenAI's; with another one both sides of the check would read the same wrong words."""
    vocabulary = shipped_vocabulary()
    have, needed = len(vocabulary.tokens), int(model.config.text_config.vocab_size)
    if have != needed:
        raise BundleError(
            f'{source}: its text encoder knows {needed} tokens, the tokenizer of CLIP {have}, and '
            'the checkpoint has no tokenizer; put its tokenizer.json beside the weights'
        )
    return vocabulary


def _input(source: str, path: Path, family: str, model: Any) -> InputSpec:
    side = _CLIPSEG_SIDE_PX if family == 'clipseg' else int(model.config.vision_config.image_size)
    usual = default_input(family, side)
    config = _preprocessor_config(source, path)
    if config is None:
        return usual
    size = config.get('crop_size' if family == 'clip' else 'size', side)
    if isinstance(size, dict):
        size = size.get('height', size.get('shortest_edge', side))
    try:
        resample = int(config.get('resample', 3 if family == 'clip' else 2))
        return InputSpec(
            int(size),
            int(size),
            usual.resize,
            _triple(config.get('image_mean', usual.mean)),
            _triple(config.get('image_std', usual.std)),
            _RESAMPLE.get(resample, usual.interpolation),
        )
    except (TypeError, ValueError) as error:
        raise BundleError(
            f'{source}: {_PREPROCESSOR} says what no image processor does ({error}); download it '
            'again'
        ) from error


def _preprocessor_config(source: str, path: Path) -> dict[str, Any] | None:
    file = path / _PREPROCESSOR
    if not path.is_dir():
        from huggingface_hub import hf_hub_download  # noqa: PLC0415 - only for ids
        from huggingface_hub.errors import HfHubHTTPError  # noqa: PLC0415

        try:
            file = Path(hf_hub_download(source, _PREPROCESSOR))
        except (OSError, ValueError, HfHubHTTPError):
            return None
    return _read_json(file) if file.is_file() else None


def _read_json(file: Path) -> dict[str, Any]:
    try:
        values = json.loads(file.read_text(encoding='utf-8'))
    except (OSError, ValueError) as error:
        raise BundleError(f'{file}: cannot be read ({error}); download it again') from error
    if not isinstance(values, dict):
        raise BundleError(f'{file}: no JSON object; download it again')
    return values


def _triple(values: Any) -> tuple[float, float, float]:
    red, green, blue = (float(value) for value in values)
    return red, green, blue


def _first_sentence(error: BaseException) -> str:
    line = (str(error).strip() or type(error).__name__).splitlines()[0]
    return line.split('. ')[0].rstrip('.')
