# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The training loop that both networks share: clock, learning rate, average, checkpoint, curve."""

from __future__ import annotations

import csv
import time
from dataclasses import dataclass
from math import cos, pi
from typing import TYPE_CHECKING, Any

import torch

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from torch import Tensor, nn

    from peace_ros.lab.training.batches import Batch, BatchMaker

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
    model: nn.Module,
    maker: BatchMaker,
    loss_of: Callable[[nn.Module, Batch], dict[str, Tensor]],
    budget: TimeBudget,
    *,
    peak_rate: float,
    folder: Path,
    name: str,
    report: Callable[[float, str], None],
    slower: tuple[str, float] = ('', 1.0),
) -> dict[str, Tensor]:
    """Train in place and return the averaged weights.

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
            _save(checkpoint, model, optimiser, average, step, elapsed_s)
    batches.close()  # type: ignore[attr-defined]
    _save(checkpoint, model, optimiser, average, step, elapsed_s)
    return average.state


def _groups(model: nn.Module, prefix: str, share: float) -> list[dict[str, Any]]:
    slow = {name for name, _ in model.named_parameters() if prefix and name.startswith(prefix)}
    groups = (
        ([value for name, value in model.named_parameters() if name not in slow], 1.0),
        ([value for name, value in model.named_parameters() if name in slow], share),
    )
    return [{'params': values, 'share': part} for values, part in groups if values]


def _save(
    path: Path, model: nn.Module, optimiser: torch.optim.Optimizer, average: Averaged,
    step: int, elapsed_s: float,
) -> None:  # fmt: skip
    partial = path.with_suffix('.part')
    torch.save(
        {
            'model': model.state_dict(),
            'optimiser': optimiser.state_dict(),
            'average': average.state,
            'step': step,
            'elapsed_s': elapsed_s,
        },
        partial,
    )
    partial.replace(path)


def _write_curve(path: Path, step: int, elapsed_s: float, means: dict[str, float]) -> None:
    new = not path.exists()
    with path.open('a', newline='') as file:
        writer = csv.writer(file)
        if new:
            writer.writerow(['step', 'elapsed_s', *means])
        writer.writerow([step, f'{elapsed_s:.1f}', *(f'{value:.5f}' for value in means.values())])
