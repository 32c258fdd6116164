# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where a model comes from: a Hugging Face id, a local folder, or an OpenAI/OpenCLIP checkpoint."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from transformers import AutoConfig, AutoTokenizer, CLIPModel, CLIPSegForImageSegmentation
from transformers import logging as transformers_logging

from peace_ros.domain import BundleError
from peace_ros.inference.export.openclip import is_openclip, load_openclip
from peace_ros.inference.export.vocabulary import Vocabulary, shipped_vocabulary
from peace_ros.inference.manifest import InputSpec

_CLASSES = {'clip': CLIPModel, 'clipseg': CLIPSegForImageSegmentation}
_OPENAI_MEAN, _OPENAI_STD = (
    (0.48145466, 0.4578275, 0.40821073),
    (0.26862954, 0.26130258, 0.27577711),
)
_IMAGENET_MEAN, _IMAGENET_STD = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)
_CLIPSEG_SIDE_PX = 352
_RESAMPLE = {2: 'bilinear', 3: 'bicubic'}
"""Pillow's numbers, as preprocessor_config.json gives them."""


@dataclass(frozen=True)
class Source:
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


def load_source(source: str) -> Source:
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
        return _source(path.stem, 'clip', model, shipped_vocabulary(), spec)
    transformers_logging.set_verbosity_error()
    family = _family(source)
    model = _load_weights(source, family)
    spec = _input(source, path, family, model)
    return _source(Path(source).name, family, model, _vocabulary(source, model), spec)


def from_model(name: str, family: str, model: Any) -> Source:
    """Wrap a model that is already in memory, with its family's usual preprocessing."""
    side = _CLIPSEG_SIDE_PX if family == 'clipseg' else int(model.config.vision_config.image_size)
    return _source(name, family, model, shipped_vocabulary(), default_input(family, side))


def default_input(family: str, side_px: int) -> InputSpec:
    """Return the family's published preprocessing."""
    if family == 'clipseg':
        return InputSpec(side_px, side_px, 'stretch', _IMAGENET_MEAN, _IMAGENET_STD, 'bilinear')
    return InputSpec(side_px, side_px, 'crop', _OPENAI_MEAN, _OPENAI_STD, 'bicubic')


def _source(name: str, family: str, model: Any, vocabulary: Vocabulary, spec: InputSpec) -> Source:
    context_length = int(model.config.text_config.max_position_embeddings)
    return Source(name, family, model.eval(), vocabulary, spec, context_length)


def _family(source: str) -> str:
    try:
        family = str(AutoConfig.from_pretrained(source).model_type)
    except (OSError, ValueError, KeyError) as error:
        raise BundleError(
            f'{source}: no model configuration could be read ({_first_line(error)}); check the '
            'name and the network, or give a folder with config.json and the weights'
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
            source, output_loading_info=True, attn_implementation='sdpa'
        )
    except Exception as error:  # safetensors, pickle and the hub have no common base
        raise BundleError(
            f'{source}: its weights cannot be read ({_first_line(error)}); download them again'
        ) from error
    missing = sorted(key for key in report['missing_keys'] if not key.endswith('position_ids'))
    odd = sorted(str(each) for each in report.get('mismatched_keys', ()))
    if missing or odd:
        examples = ', '.join((missing + odd)[:3])
        raise BundleError(
            f'{source}: {len(missing)} weights are missing and {len(odd)} are of another shape '
            f'({examples}, ...); the checkpoint is damaged or of another family'
        )
    return model


def _vocabulary(source: str, model: Any) -> Vocabulary:
    """Read the source's own; those without tokenizer files share OpenAI's."""
    try:
        tokenizer = AutoTokenizer.from_pretrained(source)
        parts = json.loads(tokenizer.backend_tokenizer.to_str())['model']
    except (OSError, ValueError, KeyError, AttributeError):
        return shipped_vocabulary()
    # Where the files are missing, transformers makes up a tokenizer of three tokens.
    if len(parts['vocab']) != model.config.text_config.vocab_size:
        return shipped_vocabulary()
    return Vocabulary.from_bpe(parts['vocab'], parts['merges'])


def _input(source: str, path: Path, family: str, model: Any) -> InputSpec:
    side = _CLIPSEG_SIDE_PX if family == 'clipseg' else int(model.config.vision_config.image_size)
    usual = default_input(family, side)
    config = _preprocessor_config(source, path)
    if config is None:
        return usual
    size = config.get('crop_size' if family == 'clip' else 'size', side)
    if isinstance(size, dict):
        size = size.get('height', size.get('shortest_edge', side))
    resample = int(config.get('resample', 3 if family == 'clip' else 2))
    return InputSpec(
        int(size),
        int(size),
        usual.resize,
        _triple(config.get('image_mean', usual.mean)),
        _triple(config.get('image_std', usual.std)),
        _RESAMPLE.get(resample, usual.interpolation),
    )


def _preprocessor_config(source: str, path: Path) -> dict[str, Any] | None:
    file = path / 'preprocessor_config.json'
    if not path.is_dir():
        from huggingface_hub import hf_hub_download  # noqa: PLC0415 - only for ids
        from huggingface_hub.errors import HfHubHTTPError  # noqa: PLC0415

        try:
            file = Path(hf_hub_download(source, 'preprocessor_config.json'))
        except (OSError, ValueError, HfHubHTTPError):
            return None
    if not file.is_file():
        return None
    config: dict[str, Any] = json.loads(file.read_text(encoding='utf-8'))
    return config


def _triple(values: Any) -> tuple[float, float, float]:
    red, green, blue = (float(value) for value in values)
    return red, green, blue


def _first_line(error: BaseException) -> str:
    return (str(error).strip() or type(error).__name__).splitlines()[0]
