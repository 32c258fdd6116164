# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Writes docs/faults.md: ``python -m peace_ros.lab.faults.table > docs/faults.md``."""

from __future__ import annotations

import sys

from peace_ros.lab.faults.bench import CAMERA_HZ, START_M
from peace_ros.lab.faults.catalogue import FAULTS, groups
from peace_ros.lab.faults.judge import FLOOR_M, OVERSHOOT_M, SILENCE_S, describe

_TITLES = {
    'camera': 'Camera',
    'prompt': 'Prompt',
    'model': 'Model',
    'heatmap': 'Heatmap',
    'world': 'The world below',
    'telemetry': 'Telemetry',
    'line': 'MAVLink line',
    'autopilot': 'Autopilot, pilot, weather',
    'process': 'Processes',
    'clock': 'Clocks',
    'thread': 'Threads of the landing node',
}


def markdown() -> str:
    """Return docs/faults.md."""
    parts = [_introduction()]
    for group in groups():
        parts.append(f'\n## {_TITLES[group]} (`{group}`)\n\n')
        parts.append(
            '| fault | what goes wrong | what the landing does | tested |\n|---|---|---|---|\n'
        )
        for fault in FAULTS:
            if fault.group == group:
                tested = f'{fault.at}: {describe(fault)}'
                tested += f'. {fault.note}' if fault.note else ''
                cells = (f'`{fault.name}`', fault.goes_wrong, fault.behaviour, tested)
                parts.append(f'| {" | ".join(cell.replace("|", "/") for cell in cells)} |\n')
    return ''.join(parts)


def _introduction() -> str:
    return f"""\
# What happens when something fails

Written by `python -m peace_ros.lab.faults.table` from `config/faults.yaml`, which `peace faults`
flies; a test keeps them equal. {len(FAULTS)} faults.

    peace faults                                  # all of them, with a report
    peace faults --list                           # what there is
    peace faults --only camera --only gnss_lost   # a group, a fault
    peace faults --only thread --repeat 20        # each of them so often
    peace faults --jobs 2 --json faults.json      # two flights at a time, the report as JSON
    peace faults --soak 60                        # one hour of flying, landing, flying again

Each fault is put into a landing of the real processes: camera, networks, landing node and
autopilot are separate processes that talk over DDS and MAVLink; relays in between lose, delay or
damage what passes, and the landing node is not told. A flight begins at {START_M:g} m, with
{CAMERA_HZ:g} frames per second and a static prompt where the fault is not about prompts. The
landing node is restarted for each fault; the others only after a fault has ended them.

The verdict rests on the true position of the vehicle and on the set-points on the wire (timed by
the kernel), not only on what the landing node says. Times are those of publishing, so that a busy
machine does not change them; a flight on a machine that is too slow for the limits is repeated
once, and the report says so. A fault fails when

- the vehicle is handed over where the labels of the world are unsafe, or a person is,
- a process ends unexpectedly, or without a sentence,
- the landing node says nothing for more than {SILENCE_S:g} s although it runs,
- the vehicle sinks more than {OVERSHOOT_M:g} m below the {FLOOR_M:g} m of the hand-over,
- a set-point is not exactly zero in IDLE, WAITING, HANDOVER, HOLD or ABORTED,
- any set-point follows ABORTED.

Times count from the injection, those of the recovery from the end of the fault.
"""


def main() -> int:
    """Print the page."""
    sys.stdout.write(markdown())
    return 0


if __name__ == '__main__':
    sys.exit(main())
