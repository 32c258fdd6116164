#!/usr/bin/env bash
# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# The main job: a simulated vehicle is brought from 100 m to 20 m over a place that the nodes
# choose from camera images alone. Sets itself up; works on a fresh machine.
#
#   launch_scripts/demo.sh                                  a world drawn from seed 1
#   launch_scripts/demo.sh --seed 3 --config dd_cs          another world, another preset
#   launch_scripts/demo.sh --world photo.jpg --gsd 0.12     your own orthophoto
#   launch_scripts/demo.sh --help                           all options
#
# Exit status 0 only when the vehicle reached 20 m over a place that is not known to be unsafe.
set -euo pipefail
# shellcheck source=launch_scripts/environment.sh
source "$(dirname "${BASH_SOURCE[0]}")/environment.sh"

prepare_environment wheels,simulation
exec peace demo "$@"
