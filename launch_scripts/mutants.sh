#!/usr/bin/env bash
# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# Mutation testing with mutmut: changes one thing at a time in what decides over a landing and asks
# whether a test fails. Takes hours, so no part of .ci/run; docs/testing.md holds the figures.
#
#   launch_scripts/mutants.sh GROUP [MUTANT...]   segmentation, mapping, landing, core or vehicle
#   launch_scripts/mutants.sh table               figures and survivors of the groups that have run
#
# Works on a copy of the tracked files in build/mutants/GROUP. What was killed there stands until
# its function changes; what survived runs again when a test has changed. Needs the environment of
# launch_scripts/test.sh and the extra "mutation".
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

usage() {
    sed -n '8,13s/^# \{0,1\}//p' "${BASH_SOURCE[0]}"
    exit 2
}

# A group is mutated against the tests beside it. What takes seconds is left out, because it would
# be run for every mutant; and a test that says what was broken is worth more.
without=
group=${1:-}
case $group in
segmentation)
    mutate=(core/segmentation/fusion.py core/segmentation/looks.py)
    tests=(core/segmentation/test_fusion.py core/segmentation/test_looks.py)
    ;;
mapping)
    mutate=(core/mapping/*.py)
    tests=(core/mapping
        --deselect=test/core/mapping/test_veto.py::test_no_order_of_frames_loses_a_veto
        --deselect=test/core/mapping/test_projection.py::test_what_a_pixel_shows_is_found_again_on_the_ground)
    ;;
landing)
    mutate=(core/landing/*.py)
    without=core/landing/core.py
    tests=(core/landing --ignore=test/core/landing/test_flights.py
        --ignore=test/core/landing/test_core.py)
    ;;
core)
    mutate=(core/landing/core.py)
    tests=(core/landing/test_core.py)
    ;;
vehicle)
    mutate=(core/vehicle/sender.py core/vehicle/obedience.py)
    tests=(core/vehicle/test_sender.py core/vehicle/test_obedience.py)
    ;;
table) exec python test/mutation_table.py build/mutants/*/ ;;
*) usage ;;
esac
shift

python - "$group" "${mutate[*]}" "${tests[*]}" "$without" <<'PYTHON'
import json
import shutil
import subprocess
import sys
from pathlib import Path

group, mutate, tests, without = sys.argv[1], sys.argv[2].split(), sys.argv[3].split(), sys.argv[4]
copy = Path('build/mutants', group)
tests_changed = False
listed = ['git', 'ls-files', '-z', '--cached', '--others', '--exclude-standard']
for name in subprocess.run(listed, capture_output=True, text=True, check=True).stdout.split('\0'):
    source, target = Path(name), copy / name
    if not source.is_file() or (
        target.is_file() and target.read_bytes() == source.read_bytes()
    ):
        continue  # a file that keeps its time keeps its results
    target.parent.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(source, target)
    tests_changed |= name.startswith('test/')
for path in (copy / 'mutants').rglob('*.py.meta') if tests_changed else ():
    # What survived is run again; mutmut would let it stand.
    results = json.loads(path.read_text(encoding='utf-8'))
    codes = results['exit_code_by_key']
    results['exit_code_by_key'] = {
        name: None if code in (0, 33) else code for name, code in codes.items()
    }
    path.write_text(json.dumps(results), encoding='utf-8')
settings = {
    'source_paths': ['peace_ros'],
    'only_mutate': [f'peace_ros/{each}' for each in mutate],
    'do_not_mutate': ['*/__init__.py', *([f'peace_ros/{without}'] if without else [])],
    # The words of a message are nobody's interface: what `raise` says, and lines that begin with
    # text in which there is a space.
    'do_not_mutate_patterns': [r'^\s*raise ', r"^\s*(return |yield |else )?[(]?f?'[^' ]+ "],
    'also_copy': ['config', 'models', 'package.xml'],
    'pytest_add_cli_args_test_selection': [
        each if each.startswith('-') else f'test/{each}' for each in tests
    ],
    'pytest_add_cli_args': ['-p', 'no:xdist', '-p', 'no:cacheprovider'],
    'timeout_constant': 20.0,
}
project = Path('pyproject.toml').read_text(encoding='utf-8')
section = '\n'.join(f'{key} = {json.dumps(value)}' for key, value in settings.items())
(copy / 'pyproject.toml').write_text(f'{project}\n[tool.mutmut]\n{section}\n', encoding='utf-8')
PYTHON

cd "build/mutants/$group"
# A process that is forked must have no threads.
export OPENCV_FOR_THREADS_NUM=1 OMP_NUM_THREADS=1 PYTHONPATH=
exec nice -n 10 mutmut run "$@"
