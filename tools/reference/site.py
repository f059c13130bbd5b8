"""What the site has beside the committed pages (a hook of mkdocs.yml): the pages of the reference,
and the text of a result in place of the paragraph that links to it.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

REPOSITORY = Path(__file__).resolve().parents[2]
RESULT = re.compile(r"^\[[^\]]*\]\(\.\./(results/[\w/]+\.md)\)$", re.MULTILINE)

sys.path.insert(0, str(REPOSITORY))  # tools is no package that is installed


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Called by MkDocs once it knows the files of ``docs``."""
    from tools.reference.pages import texts

    for name, text in texts().items():
        files.append(File.generated(config, name, content=text))
    return files


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Called by MkDocs with the text of each page."""
    return RESULT.sub(lambda link: without_title(REPOSITORY / link[1]), markdown)


def without_title(path: Path) -> str:
    return path.read_text(encoding="utf-8").partition("\n")[2]
