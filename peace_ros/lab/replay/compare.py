# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Replays compared with stored ones: the same prompts and states, nearly the same heatmaps.

    python -m peace_ros.lab.replay.compare RECORDING EXPECTED [--refresh]

``EXPECTED`` stands for two files, ``EXPECTED.json`` (prompts and states) and ``EXPECTED.npz``
(what was called safe). ``--refresh`` writes them from what the replay gives now.
"""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass
from io import BytesIO
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import PeaceError, RecordingError
from peace_ros.core.pipeline import SegmentedFrame
from peace_ros.core.presets import DEFAULT_PRESET
from peace_ros.lab.export.agreement import mask_iou
from peace_ros.lab.replay.line import Step
from peace_ros.lab.replay.report import SAFE_FROM
from peace_ros.lab.replay.run import Replayer
from peace_ros.lab.replay.source import open_source
from peace_ros.lab.replay.source_options import SourceOptions
from peace_ros.recording.run_folder import write_whole

LEAST_IOU = 0.9
"""Of what is called safe, and of what is not, over the whole recording."""
MOST_OTHER_PROMPTS = 0.05
"""Part of the frames whose words may differ: near ties turn on the last bits of the sums."""
STATE_SLACK_STEPS = 2
"""A state may begin this many decisions earlier or later: sums differ between machines."""


@dataclass(frozen=True)
class Reference:
    """What a replay gave."""

    stamps_ns: tuple[int, ...]
    """Of the frames."""
    prompts: tuple[str, ...]
    """One per frame."""
    safe: NDArray[np.bool_]
    """Frames x height x width: heatmap at or above 0.5."""
    states: tuple[tuple[str, int], ...]
    """State and how many decisions it lasted, in order."""
    was_engaged: bool

    def write(self, stem: Path) -> None:
        """Write ``stem.json`` and ``stem.npz``."""
        content = {
            'shape': list(self.safe.shape),
            'was_engaged': self.was_engaged,
            'states': [list(each) for each in self.states],
            'frames': [
                {'stamp_ns': stamp_ns, 'prompt': prompt}
                for stamp_ns, prompt in zip(self.stamps_ns, self.prompts, strict=True)
            ],
        }
        packed = BytesIO()
        np.savez_compressed(packed, safe=np.packbits(self.safe))
        write_whole(stem.with_suffix('.npz'), packed.getvalue(), 'expected replay')
        content_json = json.dumps(content, indent=1) + '\n'
        write_whole(stem.with_suffix('.json'), content_json, 'expected replay')

    @classmethod
    def read(cls, stem: Path) -> Reference:
        """Read what :meth:`write` wrote.

        Raises:
            RecordingError: the files are missing or do not belong together.
        """
        try:
            content: dict[str, Any] = json.loads(stem.with_suffix('.json').read_text())
            with np.load(stem.with_suffix('.npz')) as arrays:
                packed = arrays['safe']
            shape = tuple(content['shape'])
            safe = np.unpackbits(packed, count=int(np.prod(shape))).reshape(shape).astype(bool)
            return cls(
                tuple(frame['stamp_ns'] for frame in content['frames']),
                tuple(frame['prompt'] for frame in content['frames']),
                safe,
                tuple((str(name), int(steps)) for name, steps in content['states']),
                bool(content['was_engaged']),
            )
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise RecordingError(
                f'expected replay {stem}.json and .npz cannot be read ({error}): write them with '
                '--refresh'
            ) from error


def take_reference(recording: Path, config: str = DEFAULT_PRESET) -> Reference:
    """Replay a recording and keep what is compared."""
    replayer = Replayer(open_source(recording, SourceOptions()), config)
    looks: list[SegmentedFrame] = []
    names: list[str] = []
    for each in replayer.events():
        if isinstance(each, Step):
            names.append(each.decision.state.value)
        else:
            looks.append(each)
    if not looks:
        raise RecordingError(f'{recording}: no frame can be used: {replayer.report.first_fault}')
    return Reference(
        tuple(look.frame.stamp_ns for look in looks),
        tuple(look.prompt.template for look in looks),
        np.stack([look.heatmap.safety >= SAFE_FROM for look in looks]),
        tuple((name, len(list(steps))) for name, steps in groupby(names)),
        replayer.report.was_engaged,
    )


def differences(found: Reference, expected: Reference) -> list[str]:
    """Return a sentence per difference; empty when the replays agree."""
    told = []
    if not found.was_engaged:
        told.append('nothing was engaged: no heatmap reached the map of the landing core')
    if found.stamps_ns != expected.stamps_ns:
        told.append(
            f'{len(found.stamps_ns)} frames at other stamps than the {len(expected.stamps_ns)} '
            'expected'
        )
        return told
    wrong = [
        k for k, (a, b) in enumerate(zip(found.prompts, expected.prompts, strict=True)) if a != b
    ]
    if len(wrong) > MOST_OTHER_PROMPTS * len(found.prompts):
        first = wrong[0]
        told.append(
            f'{len(wrong)} of {len(found.prompts)} prompts differ, first at frame {first}: '
            f'{found.prompts[first]!r} instead of {expected.prompts[first]!r}'
        )
    if found.safe.shape != expected.safe.shape:
        told.append(f'heatmaps of {found.safe.shape} instead of {expected.safe.shape}')
    else:
        told += _overlaps(found.safe, expected.safe)
    return told + _state_differences(found.states, expected.states)


def _overlaps(found: NDArray[np.bool_], expected: NDArray[np.bool_]) -> list[str]:
    told = []
    for name, a, b in (('safe', found, expected), ('not safe', ~found, ~expected)):
        overlap = mask_iou(a, b)
        if overlap < LEAST_IOU:
            told.append(f'what is called {name} overlaps by {overlap:.3f}, least {LEAST_IOU}')
    return told


def _state_differences(
    found: tuple[tuple[str, int], ...], expected: tuple[tuple[str, int], ...]
) -> list[str]:
    if [name for name, _ in found] != [name for name, _ in expected]:
        return [f'states {_listed(found)} instead of {_listed(expected)}']
    slack = 2 * STATE_SLACK_STEPS
    return [
        f'state {name} lasted {steps} decisions instead of {wanted}'
        for (name, steps), (_, wanted) in zip(found, expected, strict=True)
        if abs(steps - wanted) > slack
    ]


def _listed(states: tuple[tuple[str, int], ...]) -> str:
    return ', '.join(name for name, _ in states) or 'none'


def main(arguments: list[str]) -> int:
    """Compare or refresh; return the exit status."""
    refresh = '--refresh' in arguments
    paths = [Path(each) for each in arguments if not each.startswith('--')]
    if len(paths) != 2:
        print('usage: python -m peace_ros.lab.replay.compare RECORDING EXPECTED [--refresh]')
        return 2
    recording, stem = paths
    try:
        found = take_reference(recording)
        if refresh:
            found.write(stem)
            print(f'{stem}: {len(found.prompts)} frames, states {_listed(found.states)}')
            return 0
        told = differences(found, Reference.read(stem))
    except PeaceError as error:
        print(error, file=sys.stderr)
        return 2
    for each in told:
        print(each)
    return 1 if told else 0


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
