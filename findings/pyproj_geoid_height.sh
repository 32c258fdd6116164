#!/usr/bin/env bash
# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# pyproj turns a height above the ellipsoid (GNSS) into one above mean sea level (EGM96, as MAVLink
# tells it) by leaving it as it is, when the grid of the geoid is not installed. The wheel has none.
#
# Guess before looking: about 44 m less over Paris, or an error that names the missing grid.
# Seen (pyproj 3.7.2), from EPSG:4979 to EPSG:4326+5773 (EGM96), 100 m above the ellipsoid in Paris:
#   default                           100.0 m, no error; accuracy -1, a description with "ballpark"
#   only_best=True                    100.0 m, no error
#   allow_ballpark=False              ProjError
#   TransformerGroup.best_available   False
# A terrain file in one and a flight log in the other differ by 44 m, and the code that converts them
# looks right. Ask for allow_ballpark=False.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check pyproj==3.7.2
unset PROJ_DATA PROJ_LIB
export PROJ_NETWORK=OFF PROJ_USER_WRITABLE_DIRECTORY=$folder
"$folder/venv/bin/python" -W ignore - <<'PYTHON'
from pyproj import Transformer
from pyproj.exceptions import ProjError
from pyproj.transformer import TransformerGroup

ELLIPSOID, SEA_LEVEL = 'EPSG:4979', 'EPSG:4326+5773'
PARIS = (2.35, 48.85, 100.0)

usual = Transformer.from_crs(ELLIPSOID, SEA_LEVEL, always_xy=True)
height_m = usual.transform(*PARIS)[2]
ballpark = 'ballpark' in usual.description.lower()
print(f'default: {height_m} m, accuracy {usual.accuracy}, ballpark {ballpark}')
strict = Transformer.from_crs(ELLIPSOID, SEA_LEVEL, always_xy=True, only_best=True)
best_m = strict.transform(*PARIS, errcheck=True)[2]
print(f'only_best: {best_m} m')
try:
    Transformer.from_crs(ELLIPSOID, SEA_LEVEL, always_xy=True, allow_ballpark=False)
    refused = False
except ProjError as error:
    refused = True
    print(f'allow_ballpark=False: {error}')
available = TransformerGroup(ELLIPSOID, SEA_LEVEL, always_xy=True).best_available
print(f'best_available: {available}')
unchanged = (height_m, usual.accuracy, ballpark, best_m) == (100.0, -1.0, True, 100.0)
if not unchanged or not refused or available:
    raise SystemExit('changed')
print('as stated')
PYTHON
