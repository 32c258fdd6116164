#!/usr/bin/env bash
# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# All checks of the project: style, types, import rules, unit tests with the site and the examples,
# and landings with the real processes over DDS and MAVLink. Sets itself up on a fresh machine.
#
#   launch_scripts/test.sh               everything but the tests of training and export
#   launch_scripts/test.sh --training    these too (installs torch)
#   launch_scripts/test.sh --quick       without the landings
#   anything else goes to pytest, in place of its usual arguments
set -euo pipefail
# shellcheck source=launch_scripts/environment.sh
source "$(dirname "${BASH_SOURCE[0]}")/environment.sh"

extras=wheels,test,docs
with_landing=yes
pytest_arguments=()
for argument in "$@"; do
    case $argument in
    --training) extras=wheels,test,docs,train,export ;;
    --quick) with_landing= ;;
    -h | --help)
        sed -n '5,12s/^# \{0,1\}//p' "${BASH_SOURCE[0]}"
        exit 0
        ;;
    *) pytest_arguments+=("$argument") ;;
    esac
done

prepare_environment "$extras"
cd "$checkout"

echo '== style'
ruff check .
ruff format --check .
shellcheck -x launch_scripts/*.sh launch_scripts/docker/*.sh .ci/run .ci/ubuntu-24.04
echo '== types'
mypy
echo '== import rules'
lint-imports --no-cache
echo '== tests'
if ((${#pytest_arguments[@]})); then
    exec python -m pytest "${pytest_arguments[@]}"
fi
# Two at a time, file by file, because the processes of a file may share what they set up.
python -m pytest -m 'not integration' -n 2 --dist loadfile --durations=10
if [[ $with_landing ]]; then
    echo '== landing'
    # Alone: these processes have deadlines to keep, and both cores to keep them with.
    python -m pytest -m integration
fi
