# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Checks as JUnit XML, which every continuous integration shows."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as ET

from peace_ros.lab.replay.golden import Check
from peace_ros.recording.run_folder import write_whole


def write_junit(path: Path, suite: str, checks: list[Check], seconds: float) -> None:
    """Write a test suite with one test case for each check, whole or not at all.

    Args:
        path: of the file.
        suite: name of the test suite.
        checks: in the order in which they are shown.
        seconds: that they took together.

    Raises:
        RecordingError: the place cannot be written to.
    """
    failed = [each for each in checks if not each.passed]
    counts = {'tests': str(len(checks)), 'failures': str(len(failed)), 'errors': '0'}
    root = ET.Element('testsuites', counts)
    group = ET.SubElement(root, 'testsuite', {'name': suite, 'time': f'{seconds:.3f}', **counts})
    for each in checks:
        case = ET.SubElement(
            group, 'testcase', {'classname': suite, 'name': each.name, 'time': '0'}
        )
        told = f'{each.found}; tolerance: {each.tolerance}'
        if not each.passed:
            ET.SubElement(case, 'failure', {'message': each.found}).text = told
        ET.SubElement(case, 'system-out').text = told
    ET.indent(root)
    data = ET.tostring(root, encoding='utf-8', xml_declaration=True)
    write_whole(path, data + b'\n', 'JUnit file')
