# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Disk, memory and clock of this computer."""

from __future__ import annotations

import os
import shutil
import time
from datetime import datetime, timezone
from pathlib import Path

import peace_ros
from peace_ros.lab.doctor.finding import Findings, fine, mend

DISK_MB = 1000
"""For logs of ROS, text embeddings and engines of a provider."""
MEMORY_MB = 1000
"""CLIPSeg of the true size in fp32 takes 1.03 GB at most (docs/models.md, Measuring)."""
_MEMINFO = Path('/proc/meminfo')


def check_machine() -> Findings:
    """Yield what is known of disk, memory and clock."""
    yield from check_disk(_places())
    yield from check_memory(_MEMINFO)
    yield from check_clock(time.time(), Path(peace_ros.__file__).stat().st_mtime)


def check_disk(places: dict[str, Path]) -> Findings:
    """Yield the free space of each file system on which the nodes write.

    Args:
        places: Purpose -> folder; it need not exist yet.
    """
    seen: set[int] = set()
    for purpose, place in places.items():
        folder = next(each for each in (place, *place.parents) if each.is_dir())
        device = folder.stat().st_dev
        if device in seen:
            continue
        seen.add(device)
        free_mb = shutil.disk_usage(folder).free / 1e6
        found = f'disk: {free_mb / 1000:.1f} GB free for {purpose} in {place}'
        if free_mb >= DISK_MB:
            yield fine(found, disk_free_mb=round(free_mb))
        else:
            yield mend(
                found,
                f'delete old logs and recordings until {DISK_MB / 1000:g} GB are free',
                disk_free_mb=round(free_mb),
            )


def check_memory(meminfo: Path) -> Findings:
    """Yield the memory that processes can still get, as the kernel estimates it."""
    try:
        lines = meminfo.read_text(encoding='ascii').splitlines()
    except OSError:
        return
    free_mb = next(int(each.split()[1]) for each in lines if each.startswith('MemAvailable')) / 1e3
    found = f'memory: {free_mb / 1000:.1f} GB available'
    if free_mb >= MEMORY_MB:
        yield fine(found, memory_available_mb=round(free_mb))
        return
    remedy = (
        f'end other processes until {MEMORY_MB / 1000:g} GB are available, which CLIPSeg needs '
        'in fp32; int8 and the bundled models need less'
    )
    yield mend(found, remedy, memory_available_mb=round(free_mb))


def check_clock(now_s: float, installed_s: float) -> Findings:
    """Yield whether the clock can be right: a computer without a battery starts in the past.

    Args:
        now_s: Seconds since 1970.
        installed_s: The same, when this package was installed.
    """
    now = datetime.fromtimestamp(now_s, timezone.utc)
    found = f'clock: {now:%Y-%m-%d %H:%M:%S} UTC'
    if now_s >= installed_s:
        yield fine(found)
    else:
        yield mend(
            f'{found}, before this package was installed',
            'set the clock, by NTP (timedatectl set-ntp true) or with a battery-backed clock: '
            'log files and recordings get its time',
        )


def _places() -> dict[str, Path]:
    logs = os.environ.get('ROS_LOG_DIR') or Path(os.environ.get('ROS_HOME', '~/.ros'), 'log')
    return {
        'logs of ROS': Path(logs).expanduser(),
        'models and caches': Path('~/.cache/peace_ros').expanduser(),
    }
