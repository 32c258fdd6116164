# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What to install when a package is missing: one sentence with the command.

Imports nothing that could be missing itself.
"""

from __future__ import annotations

import sys
import sysconfig
from importlib.util import find_spec
from pathlib import Path

EXTRA_OF = {
    'rasterio': 'geo',
    'jinja2': 'lab',
    'av': 'video',
    'pyulog': 'logs',
    'psutil': 'lab',
    'matplotlib': 'simulation',
    'pyarrow': 'experiment',
    'scipy': 'experiment',
    'distributed': 'experiment',
    'pooch': 'fetch',
    'requests': 'fetch',
    'openvino': 'openvino',
    'serial': 'serial',
    'torch': 'export',
    'transformers': 'export',
    'safetensors': 'export',
    'onnx': 'export',
    'starlette': 'watch',
    'uvicorn': 'watch',
    'websockets': 'watch',
}
"""Module -> the extra of setup.cfg that installs its package."""
PACKAGE_OF = {
    'cv2': 'opencv-python-headless',
    'yaml': 'PyYAML',
    'PIL': 'pillow',
    'serial': 'pyserial',
}
"""Module -> its package on PyPI, where the names differ."""
ROS_MODULES = frozenset(
    {'rclpy', 'launch', 'launch_ros', 'ament_index_python', 'std_srvs', 'tf2_ros', 'tf2_msgs'}
    | {f'{name}_msgs' for name in ('sensor', 'std', 'geometry', 'diagnostic', 'rosgraph', 'nav')}
    | {f'{name}_msgs' for name in ('lifecycle', 'visualization')}
    | {f'{name}_interfaces' for name in ('rcl', 'builtin')}
)


def how_to_install(error: ModuleNotFoundError) -> str | None:
    """Return the sentence about a package that is not installed.

    Returns:
        None: A module of this package is missing, which no command mends.
    """
    module = (error.name or '').partition('.')[0]
    if module in {'', 'peace_ros'}:
        return None
    package = PACKAGE_OF.get(module, module)
    if module in ROS_MODULES:
        command = (
            'source the setup file of ROS 2 Jazzy (on x86_64 without ROS: run '
            'pip install ".[wheels]" in the checkout)'
        )
    elif module in EXTRA_OF:
        command = f'run {_pip_install()} ".[{EXTRA_OF[module]}]" in the checkout'
    else:
        command = f'run {_pip_install()} {package}'
    return f'the package {package} is not installed: {command}'


def _pip_install() -> str:
    """Return the beginning of the command, which works where the system manages Python (PEP 668).

    That is Ubuntu 24.04 outside of a virtual environment: there pip refuses without the option.
    """
    managed = Path(sysconfig.get_path('stdlib')) / 'EXTERNALLY-MANAGED'
    if sys.prefix == sys.base_prefix and managed.exists():
        return 'pip install --break-system-packages'
    return 'pip install'


def require(*modules: str) -> None:
    """Check, without importing them, that modules are there.

    Raises:
        ModuleNotFoundError: The first that is missing; `how_to_install` turns it into a sentence.
    """
    for module in modules:
        if find_spec(module) is None:
            raise ModuleNotFoundError(f'No module named {module!r}', name=module)
