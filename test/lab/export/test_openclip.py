# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""OpenAI's and OpenCLIP's names for the weights of CLIP lead to the same network."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

torch = pytest.importorskip('torch')
pytest.importorskip('transformers')
safetensors = pytest.importorskip('safetensors.torch')

from peace_ros.core.domain import BundleError  # noqa: E402
from peace_ros.lab.export.openclip import is_openclip, load_openclip  # noqa: E402

pytestmark = pytest.mark.export

TOWERS = (('visual.', 'vision_model'), ('', 'text_model'))


def as_openclip(model: Any) -> dict[str, Any]:
    """Write the weights of a CLIPModel under OpenCLIP's names."""
    have = model.state_dict()
    state = {
        'visual.class_embedding': have['vision_model.embeddings.class_embedding'],
        'visual.conv1.weight': have['vision_model.embeddings.patch_embedding.weight'],
        'visual.positional_embedding': have['vision_model.embeddings.position_embedding.weight'],
        'visual.proj': have['visual_projection.weight'].T.contiguous(),
        'token_embedding.weight': have['text_model.embeddings.token_embedding.weight'],
        'positional_embedding': have['text_model.embeddings.position_embedding.weight'],
        'text_projection': have['text_projection.weight'].T.contiguous(),
        'logit_scale': have['logit_scale'],
    }
    for kind in ('weight', 'bias'):
        state[f'visual.ln_pre.{kind}'] = have[f'vision_model.pre_layrnorm.{kind}']
        state[f'visual.ln_post.{kind}'] = have[f'vision_model.post_layernorm.{kind}']
        state[f'ln_final.{kind}'] = have[f'text_model.final_layer_norm.{kind}']
        for prefix, tower in TOWERS:
            for index in range(2):
                ours = f'{tower}.encoder.layers.{index}'
                theirs = f'{prefix}transformer.resblocks.{index}'
                parts = [have[f'{ours}.self_attn.{each}_proj.{kind}'] for each in 'qkv']
                state[f'{theirs}.attn.in_proj_{kind}'] = torch.cat(parts)
                for a, b in (
                    ('attn.out_proj', 'self_attn.out_proj'),
                    ('ln_1', 'layer_norm1'),
                    ('ln_2', 'layer_norm2'),
                    ('mlp.c_fc', 'mlp.fc1'),
                    ('mlp.c_proj', 'mlp.fc2'),
                ):
                    state[f'{theirs}.{a}.{kind}'] = have[f'{ours}.{b}.{kind}']
    return {name: tensor.clone() for name, tensor in state.items()}


class Part(torch.nn.Module):
    """Holds weights, as the parts of OpenAI's archives do."""

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return x


def write_archive(state: dict[str, Any], path: Path) -> None:
    """Write weights as OpenAI does: a TorchScript archive, in fp16, that knows its sizes."""
    archive = Part()
    for name, tensor in state.items():
        part = archive
        *parts, last = name.split('.')
        for each in parts:
            if each not in dict(part.named_children()):
                part.add_module(each, Part())
            part = part.get_submodule(each)
        part.register_parameter(last, torch.nn.Parameter(tensor.half(), requires_grad=False))
    for name, size in (('input_resolution', 64), ('context_length', 77), ('vocab_size', 49408)):
        archive.register_buffer(name, torch.tensor(size))
    torch.jit.save(torch.jit.script(archive), str(path))


def test_an_archive_of_openai_is_the_same_network(small_clip: Any, tmp_path: Path) -> None:
    path = tmp_path / 'ViT-B-32.pt'
    write_archive(as_openclip(small_clip), path)
    assert is_openclip(path)
    model = load_openclip(path)
    assert model.config.vision_config.hidden_act == 'quick_gelu'
    assert model.config.text_config.hidden_act == 'quick_gelu'
    for name, tensor in small_clip.state_dict().items():
        if tensor.is_floating_point():
            torch.testing.assert_close(model.state_dict()[name], tensor.half().float())


@pytest.mark.parametrize('form', ['file', 'safetensors', 'folder'])
def test_the_network_is_the_same(small_clip: Any, tmp_path: Path, form: str) -> None:
    state = as_openclip(small_clip)
    if form == 'file':
        path = tmp_path / 'model.pt'
        torch.save({'state_dict': {f'module.{key}': each for key, each in state.items()}}, path)
    elif form == 'safetensors':
        path = tmp_path / 'model.safetensors'
        safetensors.save_file(state, str(path))
    else:
        path = tmp_path
        safetensors.save_file(state, str(path / 'open_clip_model.safetensors'))
        config = {'model_cfg': {'quick_gelu': True}}
        (path / 'open_clip_config.json').write_text(json.dumps(config))
    assert is_openclip(path)
    model = load_openclip(path)
    assert model.config.vision_config.hidden_act == ('quick_gelu' if form == 'folder' else 'gelu')
    for name, tensor in small_clip.state_dict().items():
        torch.testing.assert_close(model.state_dict()[name], tensor)


def test_a_damaged_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / 'cut.pt'
    path.write_bytes(b'PK\x03\x04 cut short')
    with pytest.raises(BundleError, match=r'not a readable checkpoint .* download it again'):
        load_openclip(path)


@pytest.mark.parametrize('content', [torch.zeros(2), [1, 2], {'state_dict': None}, {'epoch': 3}])
def test_a_file_of_something_else_is_refused(tmp_path: Path, content: Any) -> None:
    torch.save(content, tmp_path / 'model.pt')
    with pytest.raises(BundleError, match=r'holds something else than the weights .*; give a CLIP'):
        load_openclip(tmp_path / 'model.pt')


def test_a_file_that_would_run_code_is_refused_without_advice_to_let_it(tmp_path: Path) -> None:
    torch.save({'network': Path()}, tmp_path / 'model.pt')
    with pytest.raises(BundleError, match='cut short or more than weights') as refused:
        load_openclip(tmp_path / 'model.pt')
    assert 'weights_only' not in str(refused.value)


def test_weights_of_a_folder_without_the_folder_are_refused(
    small_clip: Any, tmp_path: Path
) -> None:
    small_clip.save_pretrained(tmp_path)
    with pytest.raises(BundleError, match='give the folder that holds it'):
        load_openclip(tmp_path / 'model.safetensors')


@pytest.mark.parametrize('gone', ['text_projection', 'ln_final.weight', 'resblocks', 'c_fc.bias'])
def test_missing_weights_are_refused(small_clip: Any, tmp_path: Path, gone: str) -> None:
    state = {key: each for key, each in as_openclip(small_clip).items() if gone not in key}
    torch.save(state, tmp_path / 'model.pt')
    with pytest.raises(BundleError, match=r'(no weight|weights are missing) .*; give a CLIP'):
        load_openclip(tmp_path / 'model.pt')


def test_weights_of_another_shape_are_refused(small_clip: Any, tmp_path: Path) -> None:
    state = as_openclip(small_clip)
    state['visual.positional_embedding'] = state['visual.positional_embedding'][:-1]
    torch.save(state, tmp_path / 'model.pt')
    with pytest.raises(BundleError, match=r'other shapes .*position_embedding.*; give a CLIP'):
        load_openclip(tmp_path / 'model.pt')


@pytest.mark.parametrize(
    ('config', 'told'),
    [
        ('{"model_cfg": ', r'open_clip_config\.json: cannot be read .*; download it again'),
        ('[]', r'open_clip_config\.json: cannot be read .*; download it again'),
        ('{"model_cfg": {}}', r'no weights in it; download open_clip_model\.safetensors'),
    ],
)
def test_a_folder_that_is_not_whole_is_refused(tmp_path: Path, config: str, told: str) -> None:
    (tmp_path / 'open_clip_config.json').write_text(config)
    with pytest.raises(BundleError, match=told):
        load_openclip(tmp_path)


def test_a_convolutional_clip_is_refused(small_clip: Any, tmp_path: Path) -> None:
    state = as_openclip(small_clip) | {'visual.layer1.0.conv1.weight': torch.zeros(1)}
    torch.save(state, tmp_path / 'rn50.pt')
    with pytest.raises(
        BundleError,
        match=r'1 are unknown \(visual\.layer1.*; give a CLIP checkpoint with a vision tr',
    ):
        load_openclip(tmp_path / 'rn50.pt')
