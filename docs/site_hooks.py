# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""MkDocs hooks: pages that lie outside docs/, and links that work on GitHub and in the site."""

from __future__ import annotations

import os
import posixpath
import re
from pathlib import Path
from typing import TYPE_CHECKING

from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, Files
from pymdownx.slugs import slugify

if TYPE_CHECKING:
    from mkdocs.config.defaults import MkDocsConfig
    from mkdocs.structure.pages import Page

ROOT = Path(__file__).resolve().parents[1]
PAGES = {
    'README.md': 'index.md',
    'models/README.md': 'bundled_models.md',
    '.github/CONTRIBUTING.md': 'contributing.md',
    '.github/SECURITY.md': 'reporting.md',
}
"""File of the repository -> page of the site."""
EXAMPLES = 'examples/README.md'
LINK = re.compile(r'\]\((?![a-z]+:|#)([^)\s#]+)(#[^)\s]*)?\)')
"""A Markdown link or image with a relative target: file, then anchor."""


def api_modules() -> list[str]:
    """Return the modules with an API page: every room of the core, recording and replay."""
    core = ROOT / 'peace_ros' / 'core'
    files = (*core.glob('[!_]*.py'), *(path.parent for path in core.glob('*/__init__.py')))
    return [*sorted(f'core.{path.stem}' for path in files), 'recording', 'lab.replay']


def on_config(config: MkDocsConfig) -> None:
    """Put the API pages last in the navigation."""
    api = {'API': [{name: f'api/{name}.md'} for name in api_modules()]}
    config.nav = [*(config.nav or []), api]


def on_files(files: Files, config: MkDocsConfig) -> None:
    """Add the pages that lie elsewhere in the repository, and one per module of the API."""
    for source, page in PAGES.items():
        files.append(File.generated(config, page, content=(ROOT / source).read_text('utf-8')))
    for name in api_modules():
        content = f'# peace_ros.{name}\n\n::: peace_ros.{name}\n'
        files.append(File.generated(config, f'api/{name}.md', content=content))


def on_page_markdown(markdown: str, page: Page, **_: object) -> str:
    """Point links at pages of the site; show the examples below their table."""
    uri = page.file.src_uri
    source = next((file for file, name in PAGES.items() if name == uri), f'docs/{uri}')
    markdown = LINK.sub(lambda link: f']({_target(source, uri, *link.groups())})', markdown)
    if uri == EXAMPLES:
        for path in sorted((ROOT / 'docs/examples').glob('*.py')):
            markdown += f'\n## {path.name}\n\n```python\n{path.read_text("utf-8")}```\n'
    return markdown


def _target(source: str, page: str, link: str, anchor: str | None) -> str:
    """Return the target of a link, relative to its page.

    Raises:
        PluginError: the site has no such page.

    """
    file = posixpath.normpath(posixpath.join(posixpath.dirname(source), link))
    if file.startswith('docs/examples/') and file.endswith('.py'):
        anchor = '#' + slugify(case='lower')(posixpath.basename(file), '-')
        file = f'docs/{EXAMPLES}'
    elif not file.startswith('docs/') and file not in PAGES:
        raise PluginError(f'{source} links to {link}: the site has no such page, name it in PAGES')
    target = PAGES.get(file) or file.removeprefix('docs/')
    return os.path.relpath(target, posixpath.dirname(page) or '.') + (anchor or '')
