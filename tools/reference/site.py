"""Adds the pages of the reference that are not committed to the site (a hook of mkdocs.yml)."""

from __future__ import annotations

import sys
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

sys.path.insert(
    0, str(Path(__file__).resolve().parents[2])
)  # tools is no package that is installed


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Called by MkDocs once it knows the files of ``docs``."""
    from tools.reference.pages import site_texts

    for name, text in site_texts().items():
        files.append(File.generated(config, name, content=text))
    return files
