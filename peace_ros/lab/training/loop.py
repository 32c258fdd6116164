# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The training loop of all networks: clock, learning rate, average, checkpoint, curve."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from math import cos, pi
from pathlib import Path
from typing import Any, TypeVar

import torch
from torch import Tensor, nn

from peace_ros.lab.training.batches import BatchT, Maker

NetworkT = TypeVar('NetworkT', bound=nn.Module)

AVERAGE_DECAY = 0.998
_CHECKPOINT_EVERY_S = 60.0
_WARM_UP = 0.02


@dataclass(frozen=True)
class TimeBudget:
    """How long to train: a number of steps when given (repeatable), else minutes."""

    minutes: float
    steps: int | None = None

    def progress(self, step: int, elapsed_s: float) -> float:
        """Return how far the training is, 0 to 1."""
        if self.steps is not None:
            return min(1.0, step / max(self.steps, 1))
        return min(1.0, elapsed_s / max(self.minutes * 60.0, 1e-9))


class Averaged:
    """Exponential mean of the weights; what is exported."""

    def __init__(self, model: nn.Module) -> None:
        self.state = {name: value.detach().clone() for name, value in model.state_dict().items()}

    def update(self, model: nn.Module, step: int) -> None:
        """Move towards the weights of the model; faster in the first steps."""
        decay = min(AVERAGE_DECAY, (1 + step) / (10 + step))
        for name, value in model.state_dict().items():
            if value.dtype.is_floating_point:
                self.state[name].lerp_(value.detach(), 1.0 - decay)
            else:
                self.state[name].copy_(value)


def learning_rate(peak: float, progress: float) -> float:
    """Return a linear warm-up, then a cosine down to a hundredth of the peak."""
    if progress < _WARM_UP:
        return peak * (0.1 + 0.9 * progress / _WARM_UP)
    return peak * (0.01 + 0.99 * 0.5 * (1.0 + cos(pi * (progress - _WARM_UP) / (1.0 - _WARM_UP))))


def train(
    model: NetworkT,
    maker: Maker[BatchT],
    loss_of: Callable[[NetworkT, BatchT], dict[str, Tensor]],
    budget: TimeBudget,
    *,
    peak_rate: float,
    folder: Path,
    name: str,
    report: Callable[[float, str], None],
    slower: tuple[str, float] = ('', 1.0),
) -> NetworkT:
    """Train in place and return the network with the averaged weights, ready to export.

    ``loss_of`` returns named losses; their sum is minimised. A checkpoint in ``folder`` is
    continued when one lies there. ``report`` gets the progress (0 to 1) and a line of figures.
    Parameters whose names begin with ``slower[0]`` learn at this part of the rate: ``slower[1]``.
    """
    folder.mkdir(parents=True, exist_ok=True)
    checkpoint, curve = folder / f'{name}.pt', folder / f'{name}.csv'
    optimiser = torch.optim.AdamW(_groups(model, *slower), lr=peak_rate, weight_decay=0.02)
    average = Averaged(model)
    step, elapsed_s = 0, 0.0
    if checkpoint.exists():
        stored: dict[str, Any] = torch.load(checkpoint, weights_only=True)
        model.load_state_dict(stored['model'])
        optimiser.load_state_dict(stored['optimiser'])
        average.state = stored['average']
        step, elapsed_s = stored['step'], stored['elapsed_s']
    else:
        curve.unlink(missing_ok=True)

    def save() -> None:
        stored = {
            'model': model.state_dict(), 'optimiser': optimiser.state_dict(),
            'average': average.state, 'step': step, 'elapsed_s': elapsed_s,
        }  # fmt: skip
        partial = checkpoint.with_suffix('.part')
        torch.save(stored, partial)
        partial.replace(checkpoint)

    model.train()
    saved_s = seen_s = time.monotonic()
    means: dict[str, float] = {}
    batches = maker.stream(step)
    while budget.progress(step, elapsed_s) < 1.0:
        progress = budget.progress(step, elapsed_s)
        for group in optimiser.param_groups:
            group['lr'] = learning_rate(peak_rate, progress) * group['share']
        losses = loss_of(model, next(batches))
        total = torch.stack(list(losses.values())).sum()
        optimiser.zero_grad(set_to_none=True)
        total.backward()  # type: ignore[no-untyped-call]
        torch.nn.utils.clip_grad_norm_(model.parameters(), 5.0)
        optimiser.step()
        average.update(model, step)
        step += 1
        now_s = time.monotonic()
        elapsed_s, seen_s = elapsed_s + now_s - seen_s, now_s
        for key, value in losses.items():
            means[key] = 0.95 * means.get(key, value.item()) + 0.05 * value.item()
        report(
            budget.progress(step, elapsed_s),
            f'step {step} ' + ' '.join(f'{key} {value:.3f}' for key, value in means.items()),
        )
        if step % 20 == 0 or budget.progress(step, elapsed_s) >= 1.0:
            _write_curve(curve, step, elapsed_s, means)
        if now_s - saved_s > _CHECKPOINT_EVERY_S:
            saved_s = now_s
            save()
    batches.close()  # type: ignore[attr-defined]
    save()
    model.load_state_dict(average.state)
    # The exporter wants contiguous memory.
    return model.to(memory_format=torch.contiguous_format).eval()  # type: ignore[call-overload]


def _groups(model: nn.Module, prefix: str, share: float) -> list[dict[str, Any]]:
    slow = {name for name, _ in model.named_parameters() if prefix and name.startswith(prefix)}
    groups = (
        ([value for name, value in model.named_parameters() if name not in slow], 1.0),
        ([value for name, value in model.named_parameters() if name in slow], share),
    )
    return [{'params': values, 'share': part} for values, part in groups if values]


def _write_curve(path: Path, step: int, elapsed_s: float, means: dict[str, float]) -> None:
    if not path.exists():
        path.write_text(','.join(('step', 'elapsed_s', *means)) + '\n')
    with path.open('a') as file:
        file.write(
            ','.join((f'{step},{elapsed_s:.1f}', *(f'{v:.5f}' for v in means.values()))) + '\n'
        )
