# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Run a module that ends with its parent: ``... simulation.demo.guarded PID MODULE ...``.

A demo that is killed outright cannot stop its nodes; on Linux the kernel does it for us.
"""

from __future__ import annotations

import ctypes
import os
import runpy
import signal
import sys

_PR_SET_PDEATHSIG = 1


def die_with_parent(parent_pid: int) -> None:
    """Ask the kernel for SIGTERM when the parent ends (Linux; elsewhere nothing happens)."""
    if sys.platform == 'linux':
        ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM, 0, 0, 0)
    if os.getppid() != parent_pid:
        # The parent ended before the kernel was asked.
        sys.exit(1)


def main() -> None:
    """Guard this process, then run the module as ``python -m`` would."""
    parent_pid, module, *arguments = sys.argv[1:]
    die_with_parent(int(parent_pid))
    # Python would answer Ctrl-C with a traceback until the node has a handler of its own.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    sys.argv = [module, *arguments]
    runpy.run_module(module, run_name='__main__', alter_sys=True)


if __name__ == '__main__':
    main()
