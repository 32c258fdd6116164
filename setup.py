# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""ament_python package: the same files serve `pip install .` and `colcon build`."""

from pathlib import Path

from setuptools import find_packages, setup

NAME = 'peace_ros'
ROOT = Path(__file__).resolve().parent

# Tells the ament index that the package is installed; its content means nothing.
MARKER = Path('config/ament') / NAME

# What nodes need at run time lies inside the installed package too, because `pip` knows no ament
# index: models/ and config/ become package data of two sub-packages. (A symlink install runs this
# file from a build folder without them and finds them in the checkout instead.)
SHIPPED = [folder for folder in ('config', 'models') if Path(__file__).with_name(folder).is_dir()]

# Training and the reading of damaged files run in a checkout, where annotations and recordings lie.
LEFT_OUT = [f'{NAME}.lab.{room}' for room in ('training', 'training.*', 'damage')]
DATA_LEFT_OUT = ['ament/*', 'annotations/*']

# ROS looks for launch files and what they name under share/, for nothing else.
SHARED = (
    'config/[!f]*.yaml',  # not faults.yaml, which only the package itself reads
    'config/*.xml',
    'config/presets/*.yaml',
    'config/rviz/*.rviz',
    'config/foxglove/*.json',
    'config/sros2/*.xml',
)

NODES = (
    'prompt_generator',
    'segmentation',
    'perception',
    'landing',
    'recorder',
    'satellite_view',
    'autopilot_sim',
    'watch',
)


def _share() -> list[tuple[str, list[str]]]:
    """List the configuration for the share directory of the ament index."""
    files_of: dict[str, list[str]] = {}
    for pattern in SHARED:
        for path in sorted(ROOT.glob(pattern)):
            relative = path.relative_to(ROOT)
            files_of.setdefault(f'share/{NAME}/{relative.parent}', []).append(str(relative))
    return sorted(files_of.items())


setup(
    name=NAME,
    python_requires='>=3.10',
    packages=[
        *find_packages(include=[NAME, f'{NAME}.*'], exclude=LEFT_OUT),
        *(f'{NAME}.{folder}' for folder in SHIPPED),
    ],
    package_dir={f'{NAME}.{folder}': folder for folder in SHIPPED},
    package_data={
        **{f'{NAME}.{folder}': ['**/*'] for folder in SHIPPED},
        f'{NAME}.lab.evaluation.segmentation': ['templates/*.j2'],
        f'{NAME}.lab.replay': ['templates/*.j2'],
        f'{NAME}.lab.experiment.report': ['templates/*.j2'],
        f'{NAME}.watch': ['page/*'],
    },
    exclude_package_data={f'{NAME}.config': DATA_LEFT_OUT} if SHIPPED else {},
    data_files=[
        ('share/ament_index/resource_index/packages', [str(MARKER)]),
        (f'share/{NAME}', ['package.xml']),
        (f'share/{NAME}/launch', ['launch_scripts/landing.launch.py']),
        *_share(),
    ],
    entry_points={
        'console_scripts': [
            'peace = peace_ros.cli.entry:peace',
            *(f'{node} = peace_ros.cli.entry:{node}' for node in NODES),
        ],
    },
)
