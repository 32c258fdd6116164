# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Judge a bag: how much of its frames is called safe, and what the landing core would have done."""

import sys
from pathlib import Path

from peace_ros.lab.replay import ReplayOptions, replay

sample = Path(__file__).parents[2] / 'test/data/small.mcap'
bag = Path(sys.argv[1]) if len(sys.argv) > 1 else sample
report, folder = replay(ReplayOptions(bag, config='peace_cs', out=Path('judged')))

print(f'{report.frames} frames, {report.unusable_frames} cannot be used')
print(f'{100 * report.mean_safe_fraction:.1f} % of the ground in view is called safe')
print(f'decisions with and without a site: {report.verdicts}')
for visit in report.states:
    print(f'  {visit["name"]} {visit["seconds"]} s')
print(f'state at the end: {report.states[-1]["name"]}; everything else in {folder}/summary.json')
