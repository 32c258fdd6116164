# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The towers of CLIP and CLIPSeg as graphs want them, over the weights of the reference model.

The arithmetic is that of ``transformers``; only what the graph does not need is left out: layers
whose output is not used, and the interpolation of positions for every image.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, cast

import torch
from torch import Tensor, nn
from torch.nn import functional

Activation = Callable[[Tensor], Tensor]

_MASKED = -1e4
"""Added to the attention of what must not be seen; small enough for fp16."""


class Threefold(nn.Linear):
    """Query, key and value of one input: one module to measure and scale, three products to run.

    As one wide product they would have to be cut apart again, a copy that costs CPUs more than
    the wider product gains.
    """

    def forward(self, x: Tensor) -> Any:
        """[..., in] -> three of [..., out / 3]."""
        third = self.out_features // 3
        parts = [slice(start, start + third) for start in range(0, 3 * third, third)]
        return tuple(functional.linear(x, self.weight[part], self.bias[part]) for part in parts)


class SelfAttention(nn.Module):
    """Multi-head self-attention."""

    def __init__(self, reference: Any) -> None:
        super().__init__()
        self.heads = int(reference.num_heads)
        self.width = int(reference.embed_dim)
        self.scale = float(reference.scale)
        parts = (reference.q_proj, reference.k_proj, reference.v_proj)
        self.project_in = Threefold(self.width, 3 * self.width)
        self.project_in.weight = nn.Parameter(torch.cat([part.weight for part in parts]))
        self.project_in.bias = nn.Parameter(torch.cat([part.bias for part in parts]))
        # The scale goes into the query's weights, which costs nothing at run time.
        with torch.no_grad():
            self.project_in.weight[: self.width] *= self.scale
            self.project_in.bias[: self.width] *= self.scale
        self.project_out = reference.out_proj

    def forward(self, x: Tensor, mask: Tensor | None = None) -> Tensor:
        """Attend over [B, L, D]; the mask is added to the scores."""
        batch, length = x.shape[0], x.shape[1]
        split = (batch, length, self.heads, self.width // self.heads)
        query, key, value = (each.reshape(split).transpose(1, 2) for each in self.project_in(x))
        scores = query @ key.transpose(2, 3)
        if mask is not None:
            scores = scores + mask
        mixed = torch.softmax(scores, dim=-1) @ value
        joined = mixed.transpose(1, 2).reshape(batch, length, self.width)
        return cast('Tensor', self.project_out(joined))


class Layer(nn.Module):
    """One transformer layer; CLIP normalises before each half, CLIPSeg's decoder after it."""

    def __init__(self, reference: Any, *, norm_first: bool) -> None:
        super().__init__()
        self.norm_first = norm_first
        self.attention = SelfAttention(reference.self_attn)
        self.norm1 = reference.layer_norm1
        self.norm2 = reference.layer_norm2
        self.before_widen: nn.Module = nn.Identity()
        """Set where the input of ``widen`` is quantised and its unchanged value is needed too."""
        self.widen = reference.mlp.fc1
        self.narrow = reference.mlp.fc2
        self.activation: Activation = reference.mlp.activation_fn

    def forward(self, x: Tensor, mask: Tensor | None = None) -> Tensor:
        """Keep the shape [B, L, D]."""
        if self.norm_first:
            x = x + self.attention(self.norm1(x), mask)
            return x + self._mix(self.norm2(x))
        x = self.norm1(x + self.attention(x, mask))
        return cast('Tensor', self.norm2(x + self._mix(x)))

    def _mix(self, x: Tensor) -> Tensor:
        wide = self.activation(self.widen(self.before_widen(x)))
        return cast('Tensor', self.narrow(wide))


class VisionTrunk(nn.Module):
    """Pixels -> the tokens after chosen layers; layers after the last chosen one are left out."""

    def __init__(self, reference: Any, read_after: Sequence[int], side_px: int) -> None:
        """Take the weights of a vision model for square images.

        Args:
            reference: ``vision_model`` of a CLIP or CLIPSeg model.
            read_after: indices of the layers whose output is wanted, rising.
            side_px: side of the image.
        """
        super().__init__()
        embeddings = reference.embeddings
        self.patches = embeddings.patch_embedding
        width = int(embeddings.embed_dim)
        self.rows = side_px // int(embeddings.patch_size)
        with torch.no_grad():
            blank = torch.zeros(1, self.rows**2 + 1, width)
            positions = embeddings.interpolate_pos_encoding(blank, side_px, side_px)
            self.class_token = nn.Parameter(embeddings.class_embedding + positions[0, 0])
            self.positions = nn.Parameter(positions[:, 1:].clone())
        self.norm = reference.pre_layrnorm
        self.read_after = tuple(read_after)
        layers = reference.encoder.layers[: self.read_after[-1] + 1]
        self.layers = nn.ModuleList([Layer(layer, norm_first=True) for layer in layers])

    def forward(self, pixel_values: Tensor) -> list[Tensor]:
        """Return the tokens [1, 1 + patches, width] after each chosen layer."""
        patches = self.patches(pixel_values).flatten(2).transpose(1, 2) + self.positions
        x = self.norm(torch.cat([self.class_token[None, None], patches], dim=1))
        read = []
        for index, layer in enumerate(self.layers):
            x = layer(x)
            if index in self.read_after:
                read.append(x)
        return read


class ClipImageTower(nn.Module):
    """Pixels -> image embedding."""

    def __init__(self, reference: Any, side_px: int) -> None:
        super().__init__()
        vision = reference.vision_model
        self.trunk = VisionTrunk(vision, [len(vision.encoder.layers) - 1], side_px)
        self.norm = vision.post_layernorm
        self.project = reference.visual_projection

    def forward(self, pixel_values: Tensor) -> Tensor:
        """[1, 3, H, W] -> [1, D]."""
        (tokens,) = self.trunk(pixel_values)
        return cast('Tensor', self.project(self.norm(tokens[:, 0])))


class TextTower(nn.Module):
    """Token ids -> text embedding, for CLIP and CLIPSeg alike."""

    def __init__(self, reference: Any, end_of_text: int) -> None:
        super().__init__()
        text = reference.text_model
        self.tokens = text.embeddings.token_embedding
        self.positions = text.embeddings.position_embedding.weight
        self.layers = nn.ModuleList([Layer(each, norm_first=True) for each in text.encoder.layers])
        self.norm = text.final_layer_norm
        self.project = reference.text_projection
        self.end_of_text = end_of_text

    def forward(self, input_ids: Tensor, attention_mask: Tensor) -> Tensor:
        """[B, L] and [B, L] -> [B, D]; read where the text ends."""
        length = input_ids.shape[1]
        steps = torch.arange(length, device=input_ids.device)
        later = (steps[None, :] > steps[:, None]).float()[None, None]
        padding = (1.0 - attention_mask.float())[:, None, None, :]
        mask = _MASKED * torch.maximum(later, padding)
        x = self.tokens(input_ids) + self.positions[:length]
        for layer in self.layers:
            x = layer(x, mask)
        # The first end mark counts: CLIP's tokenizers pad with that very token.
        end = (input_ids == self.end_of_text).float().argmax(dim=1)
        at_end = functional.one_hot(end, length).float()[:, None, :]
        return cast('Tensor', self.project(self.norm((at_end @ x)[:, 0])))


class ClipSegImageTower(nn.Module):
    """Pixels -> what the decoder needs of them: each read layer, reduced to the decoder's width."""

    def __init__(self, reference: Any, side_px: int) -> None:
        super().__init__()
        layers = sorted(int(layer) for layer in reference.extract_layers)
        self.trunk = VisionTrunk(reference.clip.vision_model, layers, side_px)
        self.rows = self.trunk.rows
        # The decoder reads the deepest layer first.
        self.reduces = nn.ModuleList(list(reference.decoder.reduces)[::-1])

    def forward(self, pixel_values: Tensor) -> tuple[Tensor, ...]:
        """[1, 3, H, W] -> one [1, 1 + patches, width] per read layer, the shallowest first."""
        read = self.trunk(pixel_values)
        return tuple(reduce(each) for reduce, each in zip(self.reduces, read, strict=True))
