"""``report.html``: one page about a run, an evaluation or a sweep, for a browser. It needs no network, no other file.

The same results give the same bytes. Everything that the page shows is in it as JSON; nothing of it is ever taken for
HTML or for a script, and the page's own security policy forbids it to load or to send anything.
"""

from __future__ import annotations

import base64
import hashlib
import json
import re
from collections.abc import Mapping, Sequence
from html import escape
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

from genie_sim.errors import UserError
from genie_sim.paths import atomic_write
from genie_sim.recording import provenance
from genie_sim.report.data import page_data

if TYPE_CHECKING:
    from genie_sim.recording.results import Run

NAME = "report.html"
STYLES = ("page.css",)
SCRIPTS = ("charts.js", "replay.js", "story.js", "page.js")


def write(path: Path, run: Run, start_ns: int = 0) -> None:
    """Writes the page about ``run``. A long run is replayed from ``start_ns`` on, as far as the page's size allows.

    Raises ``UserError`` if ``path`` cannot be written.
    """
    write_text(path, page(run, start_ns))


def write_of(folder: Path, path: Path, start_ns: int = 0) -> None:
    """Writes the page about whatever a folder holds: a run, an evaluation or a sweep. Raises ``UserError``."""
    from genie_sim.paper import page as evaluation
    from genie_sim.recording import results
    from genie_sim.sweep import page as sweep

    of_many = {"verdicts.json": evaluation.write, "sweep.json": sweep.write}
    for name, write_page in of_many.items():
        if (folder / name).is_file():
            if start_ns:
                raise UserError(f"--start: {folder} holds no single run; only the page of a run has a replay")
            return write_page(path, folder)
    return write(path, results.load(folder), start_ns)


def write_text(path: Path, text: str) -> None:
    """Beside and renamed. Raises ``UserError``."""
    with atomic_write(path) as beside:
        beside.write_text(text, encoding="utf-8")


def page(run: Run, start_ns: int = 0) -> str:
    """The text of the page about ``run``. Raises ``UserError`` for one from a folder that this version did not write.
    """
    with provenance.of_this_version(run.folder):
        return assemble("page.html", STYLES, SCRIPTS, f"{run.name}, run {run.run_id}", page_data(run, start_ns))


def assemble(
    frame: str, styles: Sequence[str], scripts: Sequence[str], title: str, data: Mapping[str, Any],
    pictures: bool = False,
) -> str:  # fmt: skip
    """A page from its parts. Its policy allows its own script and style, and ``pictures`` that are in its data."""
    style = "\n".join(map(_part, styles))
    script = '"use strict";\n' + "\n".join(map(_part, scripts))
    allowed = f"script-src {_source(script)}; style-src {_source(style)}{'; img-src data:' if pictures else ''}"
    parts = {
        "policy": f"default-src 'none'; {allowed}; base-uri 'none'",
        "title": escape(title),
        "style": style,
        "data": as_json(data),
        "script": script,
    }
    return re.sub("%([a-z]+)%", lambda mark: parts[mark[1]], _part(frame))


def as_json(value: Any) -> str:
    """JSON that may stand inside a ``<script>`` element: no text in it can end the element or begin a comment."""
    text = json.dumps(value, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _source(text: str) -> str:
    """What allows exactly this text in a Content-Security-Policy."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


def _part(name: str) -> str:
    return resources.files(__package__).joinpath(name).read_text(encoding="utf-8")
