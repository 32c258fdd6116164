# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# Sourced by demo.sh and test.sh. Keeps one virtual environment in .venv/ of the checkout, and all
# traffic on this machine. Usage: prepare_environment EXTRA[,EXTRA...]

checkout=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
venv=$checkout/.venv

die() {
    echo "$*" >&2
    exit 2
}

find_python() {
    local candidate
    for candidate in ${PYTHON:-} python3.12 python3.14 python3.13 python3.11 python3.10 python3; do
        if "$candidate" -c 'import sys, venv, ensurepip
sys.exit(not (3, 10) <= sys.version_info[:2] <= (3, 14))' 2>/dev/null; then
            command -v "$candidate"
            return
        fi
    done
    die "No CPython 3.10 to 3.14 with venv was found: install one (Debian: python3-venv) or name it with PYTHON=/path/to/python3."
}

prepare_environment() {
    local extras=$1 stamp want python
    stamp=$venv/.installed-$extras
    [ -x "$venv/bin/python" ] || {
        python=$(find_python) || exit 2
        echo "Making .venv with $("$python" --version) ..."
        "$python" -m venv "$venv" || die "The virtual environment could not be made in $venv: see above."
    }
    want=$(cat "$checkout/setup.py" "$checkout/setup.cfg" "$checkout/pyproject.toml" | cksum)
    if [ "$(cat "$stamp" 2>/dev/null)" != "$want" ]; then
        echo "Installing peace_ros[$extras] from PyPI (about a minute the first time) ..."
        "$venv/bin/python" -m pip install --quiet --disable-pip-version-check \
            --editable "$checkout[$extras]" >"$venv/install.log" 2>&1 || {
            tail -n 15 "$venv/install.log" >&2
            die "The packages could not be installed: see above and $venv/install.log; is PyPI reachable?"
        }
        echo "$want" >"$stamp"
    fi

    # The wheels set no ament prefix; nothing may leave this machine.
    export PATH=$venv/bin:$PATH VIRTUAL_ENV=$venv AMENT_PREFIX_PATH=$venv
    export ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST
    export ROS_DOMAIN_ID=${ROS_DOMAIN_ID:-$((1 + $$ % 100))}
    export ROS_LOG_DIR=${ROS_LOG_DIR:-$venv/ros-log}
    unset PYTHONPATH _ROS_WHEELS_BOOTSTRAP_COMPLETE LD_LIBRARY_PATH
}
