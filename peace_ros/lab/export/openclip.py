# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""OpenAI and OpenCLIP checkpoints of CLIP, put into the reference network of transformers."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from safetensors.torch import load_file
from torch import Tensor
from transformers import CLIPConfig, CLIPModel

from peace_ros.core.domain import BundleError

_CONFIG = 'open_clip_config.json'
_WEIGHTS = (
    'open_clip_model.safetensors',
    'open_clip_pytorch_model.safetensors',
    'open_clip_pytorch_model.bin',
)
SUFFIXES = ('.pt', '.pth', '.bin', '.safetensors')
_HEAD_WIDTH = 64
"""Of every vision and text tower that OpenAI and OpenCLIP call ViT-B or ViT-L."""

_RENAMES = (
    ('visual.transformer.resblocks', 'vision_model.encoder.layers'),
    ('transformer.resblocks', 'text_model.encoder.layers'),
    ('.attn.', '.self_attn.'),
    ('.ln_1', '.layer_norm1'),
    ('.ln_2', '.layer_norm2'),
    ('.c_fc', '.fc1'),
    ('.c_proj', '.fc2'),
    ('visual.class_embedding', 'vision_model.embeddings.class_embedding'),
    ('visual.conv1', 'vision_model.embeddings.patch_embedding'),
    ('visual.positional_embedding', 'vision_model.embeddings.position_embedding.weight'),
    ('visual.ln_pre', 'vision_model.pre_layrnorm'),
    ('visual.ln_post', 'vision_model.post_layernorm'),
    ('visual.proj', 'visual_projection.weight'),
    ('token_embedding', 'text_model.embeddings.token_embedding'),
    ('positional_embedding', 'text_model.embeddings.position_embedding.weight'),
    ('ln_final', 'text_model.final_layer_norm'),
    ('text_projection', 'text_projection.weight'),
)
"""Parts of names in these checkpoints and in transformers, replaced in this order."""
_TRANSPOSED = ('visual_projection.weight', 'text_projection.weight')
_SIZES = ('input_resolution', 'context_length', 'vocab_size', 'attn_mask')
_HUGGING_FACE = ('text_model.', 'vision_model.', 'clip.', 'visual_projection', 'logit_bias')


def is_openclip(path: Path) -> bool:
    """Tell whether a path looks like such a checkpoint."""
    if path.is_dir():
        return (path / _CONFIG).is_file() and not (path / 'config.json').is_file()
    return path.suffix in SUFFIXES


def load_openclip(path: Path) -> CLIPModel:
    """Load a checkpoint file, or a folder with open_clip_config.json; raises BundleError."""
    quick, file = _look_into(path) if path.is_dir() else (None, path)
    state, is_openai = _read(file)
    weights = _translate(state, path)
    gelu = 'quick_gelu' if (is_openai if quick is None else quick) else 'gelu'
    model = CLIPModel(_config(weights, path, gelu))
    try:
        report = model.load_state_dict(weights, strict=False)
    except RuntimeError as error:
        example = str(error).splitlines()[-1].strip().rstrip('.')
        raise BundleError(
            f'{path}: weights of other shapes than a CLIP has ({example}); give a CLIP checkpoint '
            'with a vision transformer'
        ) from error
    missing = [key for key in report.missing_keys if not key.endswith('position_ids')]
    if missing or report.unexpected_keys:
        raise BundleError(
            f'{path}: {len(missing)} weights are missing and {len(report.unexpected_keys)} are '
            f'unknown ({", ".join([*missing, *report.unexpected_keys][:3])}, ...); give a CLIP '
            'checkpoint with a vision transformer'
        )
    return model.eval()


def _look_into(folder: Path) -> tuple[bool, Path]:
    """Return whether the network uses the quick GELU, and the file of its weights."""
    config = folder / _CONFIG
    try:
        values = json.loads(config.read_text(encoding='utf-8'))
        quick = bool(values.get('model_cfg', values).get('quick_gelu', False))
    except (OSError, ValueError, AttributeError) as error:
        raise BundleError(f'{config}: cannot be read ({error}); download it again') from error
    file = next((folder / name for name in _WEIGHTS if (folder / name).is_file()), None)
    if file is None:
        raise BundleError(
            f'{folder}: {_CONFIG}, but no weights in it; download {", ".join(_WEIGHTS[:-1])} or '
            f'{_WEIGHTS[-1]} too'
        )
    return quick, file


def _read(file: Path) -> tuple[Mapping[str, Tensor], bool]:
    """Return the state and whether it is an archive of OpenAI's, which use the quick GELU."""
    try:
        if file.suffix == '.safetensors':
            return load_file(str(file)), False
        try:
            archive = torch.jit.load(str(file), map_location='cpu')
            return archive.state_dict(), True
        except RuntimeError:
            state = torch.load(str(file), map_location='cpu', weights_only=True)
    except Exception as error:  # pickle, zip and safetensors have no common base
        # The message of torch has many lines and advises to let the file run code.
        raise BundleError(
            f'{file}: not a readable checkpoint ({file.stat().st_size} bytes, cut short or more '
            'than weights); download it again, or give a CLIP checkpoint'
        ) from error
    if isinstance(state, dict):
        state = state.get('state_dict', state)
    if not isinstance(state, dict) or not all(isinstance(each, Tensor) for each in state.values()):
        raise BundleError(
            f'{file}: holds something else than the weights of one network; give a CLIP '
            'checkpoint, or save the state_dict of its model alone'
        )
    return {key.removeprefix('module.'): value for key, value in state.items()}, False


def _translate(state: Mapping[str, Tensor], path: Path) -> dict[str, Tensor]:
    """Return the weights under the names of transformers."""
    if any(key.startswith(_HUGGING_FACE) for key in state):
        raise BundleError(
            f'{path}: its weights have the names of save_pretrained; give the folder that holds it '
            'and its config.json'
        )
    weights: dict[str, Tensor] = {}
    for key, value in state.items():
        name, tensor = key, value.float()
        for old, new in _RENAMES:
            name = name.replace(old, new)
        stem, joined, kind = name.partition('in_proj_')
        if joined:
            for part, third in zip('qkv', tensor.chunk(3), strict=True):
                weights[f'{stem}{part}_proj.{kind}'] = third.contiguous()
        elif name not in _SIZES:
            weights[name] = tensor.T.contiguous() if name in _TRANSPOSED else tensor
    return weights


def _config(weights: Mapping[str, Tensor], path: Path, activation: str) -> CLIPConfig:
    try:
        patches = weights['vision_model.embeddings.patch_embedding.weight']
        positions = weights['vision_model.embeddings.position_embedding.weight']
        words = weights['text_model.embeddings.token_embedding.weight']
        text_positions = weights['text_model.embeddings.position_embedding.weight']
        projection_dim = weights['text_projection.weight'].shape[0]
        widths = {
            side: len(weights[f'{side}.encoder.layers.0.mlp.fc1.bias'])
            for side in ('vision_model', 'text_model')
        }
    except KeyError as error:
        raise BundleError(
            f'{path}: no weight {error}; give a CLIP checkpoint with a vision transformer'
        ) from error
    patch = int(patches.shape[2])
    rows = round((positions.shape[0] - 1) ** 0.5)

    def tower(side: str, width: int) -> dict[str, Any]:
        return {
            'hidden_size': width,
            'intermediate_size': widths[side],
            'num_attention_heads': width // _HEAD_WIDTH,
            'num_hidden_layers': 1 + max(
                int(key.split('.')[3]) for key in weights if key.startswith(f'{side}.encoder')
            ),
            'hidden_act': activation,
            'projection_dim': projection_dim,
        }  # fmt: skip

    vision = tower('vision_model', int(patches.shape[0]))
    vision.update(patch_size=patch, image_size=patch * rows)
    text = tower('text_model', int(words.shape[1]))
    text.update(
        vocab_size=int(words.shape[0]),
        max_position_embeddings=int(text_positions.shape[0]),
        eos_token_id=int(words.shape[0]) - 1,
    )
    return CLIPConfig(text_config=text, vision_config=vision, projection_dim=projection_dim)
