# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Why a frame does not show how the vehicle moves."""

from __future__ import annotations

from enum import Enum


class Doubt(Enum):
    """Why a frame does not show how the vehicle moves."""

    UNALIGNED = 'no position and attitude to begin from'
    OLD = 'the picture is not newer than the last one'
    RATES = 'no body rates from the last picture to this one'
    ALTITUDE = 'the altitude is not known, or below 1 m'
    SAME = 'the camera gave the same picture twice'
    TEXTURE = 'the ground has too little texture in two directions'
    DIFFERENT = 'too few corners of the ground are found again'
    TURN = 'the pictures turn otherwise than the body rates'
    ERROR = 'the corners do not move like level ground'
    MOVABLE = 'too little of the ground in view is sure to keep still'
    MOVING = 'the velocity over ground does not change as the vehicle is accelerated'
    BEGINNING = 'too few pictures for a velocity'
    UNCERTAIN = 'the velocity is too uncertain'
