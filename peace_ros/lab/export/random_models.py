# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reference networks of the true sizes with random weights: same speed, no download."""

from __future__ import annotations

import torch
from transformers import CLIPConfig, CLIPModel, CLIPSegConfig, CLIPSegForImageSegmentation

from peace_ros.core.domain import ConfigurationError

_TOKENS = 49408
_END = _TOKENS - 1
_END_MARKS = {'bos_token_id': _END - 1, 'eos_token_id': _END, 'pad_token_id': _END}
_FILM_GAIN = 3.0
"""Makes terms differ as much as places do; the library's own initialisation hides them."""
_LOGIT_SPREAD = 2.0


def random_clip(size: str, seed: int = 0) -> CLIPModel:
    """Return a CLIP of the size ``ViT-B/32``, ``ViT-B/16`` or ``ViT-L/14``."""
    widths = {'ViT-B/32': (768, 512, 32), 'ViT-B/16': (768, 512, 16), 'ViT-L/14': (1024, 768, 14)}
    if size not in widths:
        raise ConfigurationError(f'CLIP {size!r}: choose one of {", ".join(widths)}')
    vision, text, patch = widths[size]
    torch.manual_seed(seed)
    config = CLIPConfig(
        vision_config=_tower(vision, 24 if vision == 1024 else 12)
        | {'patch_size': patch, 'image_size': 224},
        text_config=_tower(text, 12) | _END_MARKS,
        projection_dim=text,
    )
    return CLIPModel(config).eval()


def random_clipseg(kind: str = 'rd64', seed: int = 0) -> CLIPSegForImageSegmentation:
    """Return a CLIPSeg of the kind ``rd64``, ``rd64-refined`` or ``rd16`` (ViT-B/16, 352 px)."""
    decoders = {'rd64': (64, False), 'rd64-refined': (64, True), 'rd16': (16, False)}
    if kind not in decoders:
        raise ConfigurationError(f'CLIPSeg {kind!r}: choose one of {", ".join(decoders)}')
    torch.manual_seed(seed)
    config = CLIPSegConfig(
        vision_config={'patch_size': 16, 'image_size': 352},
        text_config=_END_MARKS,
        reduce_dim=decoders[kind][0],
        use_complex_transposed_convolution=decoders[kind][1],
    )
    model = CLIPSegForImageSegmentation(config).eval()
    with torch.no_grad():
        _let_terms_matter(model)
    return model


def _tower(width: int, layers: int) -> dict[str, int]:
    return {
        'hidden_size': width,
        'intermediate_size': 4 * width,
        'num_hidden_layers': layers,
        'num_attention_heads': width // 64,
    }


def _let_terms_matter(model: CLIPSegForImageSegmentation) -> None:
    """Give FiLM, the reductions and the last layer weights as strong as training makes them."""
    decoder = model.decoder
    texts = torch.randint(0, _TOKENS - 2, (16, 12))
    texts[:, -1] = _TOKENS - 1
    embeddings = model.clip.get_text_features(texts).pooler_output
    mean = embeddings.mean(dim=0)
    spread = float((embeddings - mean).norm(dim=1).mean())
    for film, offset in ((decoder.film_mul, 1.0), (decoder.film_add, 0.0)):
        film.weight.normal_(0.0, _FILM_GAIN / spread)
        film.bias.copy_(offset - film.weight @ mean)
    for reduce in decoder.reduces:
        # Otherwise the deeper features hide the effect of the terms on the first ones.
        reduce.weight.normal_(0.0, reduce.in_features**-0.5)
    steps = decoder.transposed_convolution
    last = steps[-1] if isinstance(steps, torch.nn.Sequential) else steps
    pixels = torch.randn(1, 3, 352, 352).expand(2, -1, -1, -1)
    logits = model(input_ids=texts[:2], pixel_values=pixels).logits
    last.weight *= _LOGIT_SPREAD / logits.std()
