# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Cuts the power of the recorder (kill -9) at random moments, and reads what is left.

    python -m peace_ros.lab.recorder.cuts --times 100

The topics of a landing flow all the time. Each file must open, hold every kind of topic and frames
that can be decoded, and reach to within a second of the cut.
"""

from __future__ import annotations

import random
import signal
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from peace_ros.core.domain import PeaceError
from peace_ros.lab.recorder.landing_topics import (
    LandingTopics,
    newest_recording,
    recorder_process,
)
from peace_ros.lab.replay.source import open_source
from peace_ros.lab.replay.source_options import SourceOptions
from peace_ros.recording import BagReader
from peace_ros.simulation.demo.isolation import isolate

MOST_LOST_S = 1.0
_EXPECTED = {
    '/camera_info',
    '/heatmap',
    '/image/compressed',
    '/landing/pose',
    '/landing/setpoint',
    '/landing/status',
    '/prompt',
}
_FIRST_S, _LAST_S = 0.0, 3.0
"""The cut comes so long after the first frames."""
_START_S = 60.0


@dataclass(frozen=True)
class Remains:
    """What a cut left."""

    lost_s: float
    """From the last message to the cut; infinite where nothing can be read."""
    frames: int
    fault: str
    """Empty when the file can be replayed."""

    @property
    def passed(self) -> bool:
        """The file can be replayed up to the last second."""
        return not self.fault and self.lost_s <= MOST_LOST_S


def cut_once(folder: Path, chance: random.Random) -> Remains:
    """Record into a new folder, kill the recorder, and read the file.

    The topics must flow already.
    """
    with recorder_process(folder) as process:
        path = newest_recording(folder, _START_S)
        if path is None:
            return Remains(float('inf'), 0, 'no frames came')
        time.sleep(chance.uniform(_FIRST_S, _LAST_S))
        process.send_signal(signal.SIGKILL)
        cut_s = time.time()
        process.wait()
    return read_remains(path, cut_s)


def read_remains(path: Path, cut_s: float) -> Remains:
    """Return what can be read of a file that was cut at a time of the wall clock."""
    try:
        with BagReader(path) as bag:
            missing = _EXPECTED - {*bag.topics}
            last_ns = max(at_ns for _, at_ns, _ in bag.messages([*bag.topics]))
        taken = list(open_source(path, SourceOptions()).frames())
    except (PeaceError, ValueError) as error:
        return Remains(float('inf'), 0, str(error))
    faults = [each.fault for each in taken if each.frame is None]
    fault = f'no {", ".join(sorted(missing))}' if missing else ''
    return Remains(cut_s - last_ns * 1e-9, len(taken) - len(faults), fault or ''.join(faults[:1]))


def main(
    times: Annotated[int, typer.Option(help='Cuts.')] = 100,
    seed: Annotated[int, typer.Option(help='Of the random moments.')] = 1,
) -> None:
    """Cut, print each result, and exit with status 1 when one file is not as it must be."""
    chance = random.Random(seed)
    with tempfile.TemporaryDirectory() as place:
        isolate(Path(place) / 'ros')
        with LandingTopics():
            found = []
            for number in range(times):
                found.append(cut_once(Path(place) / f'cut_{number}', chance))
                verdict = 'can be replayed' if found[-1].passed else 'FAILED'
                typer.echo(f'cut {number}: {verdict}, {found[-1]}')
    good = [each for each in found if each.passed]
    lost = sorted(each.lost_s for each in found)
    typer.echo(
        f'{len(good)} of {times} files can be replayed; lost {lost[len(lost) // 2]:.2f} s in the '
        f'median, at most {lost[-1]:.2f} s; {sum(each.frames for each in found)} frames'
    )
    if len(good) < times:
        raise typer.Exit(1)


if __name__ == '__main__':
    typer.run(main)
