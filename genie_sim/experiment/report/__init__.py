"""``report.html``: one page about one run, to be opened in a browser. It needs no network and no other file.

The same run gives the same bytes. Everything that the page shows is in it as JSON; nothing of it is ever taken for
HTML or for a script, and the page's own security policy forbids it to load or to send anything.
"""

from __future__ import annotations

import base64
import hashlib
import json
import re
from html import escape
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

from genie_sim.errors import UserError
from genie_sim.experiment.report.data import page_data

if TYPE_CHECKING:
    from genie_sim.experiment.results import Run

NAME = "report.html"
SCRIPTS = ("charts.js", "replay.js", "story.js", "page.js")


def write(path: Path, run: Run, start_ns: int = 0) -> None:
    """Writes the page about ``run``. A long run is replayed from ``start_ns`` on, as far as the page's size allows.

    Raises ``UserError`` if ``path`` cannot be written.
    """
    beside = path.with_name(f".{path.name}.partial")
    try:
        beside.write_text(page(run, start_ns), encoding="utf-8")
        beside.replace(path)
    except OSError as error:
        raise UserError(f"{path}: cannot be written: {error.strerror or error}") from error
    finally:
        beside.unlink(missing_ok=True)


def page(run: Run, start_ns: int = 0) -> str:
    """The text of the page about ``run``."""
    style = _part("page.css")
    script = '"use strict";\n' + "\n".join(map(_part, SCRIPTS))
    policy = f"default-src 'none'; script-src {_source(script)}; style-src {_source(style)}; base-uri 'none'"
    parts = {
        "policy": policy,
        "title": escape(f"{run.name}, run {run.run_id}"),
        "style": style,
        "data": as_json(page_data(run, start_ns)),
        "script": script,
    }
    return re.sub("%([a-z]+)%", lambda mark: parts[mark[1]], _part("page.html"))


def as_json(value: Any) -> str:
    """JSON that may stand inside a ``<script>`` element: no text in it can end the element or begin a comment."""
    text = json.dumps(value, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _source(text: str) -> str:
    """What allows exactly this text in a Content-Security-Policy."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


def _part(name: str) -> str:
    return resources.files(__package__).joinpath(name).read_text(encoding="utf-8")
