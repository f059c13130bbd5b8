"""``report.html``: one page about a run, an evaluation or a sweep, for a browser. It needs no network, no other file.

The same results give the same bytes. Everything that the page shows is in it as JSON; nothing of it is ever taken for
HTML or for a script, and the page's own security policy forbids it to load or to send anything.
"""

import base64
import hashlib
import json
import re
from collections.abc import Mapping, Sequence
from html import escape
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

from genie_sim.analysis import style
from genie_sim.paths import atomic_write
from genie_sim.recording import provenance
from genie_sim.report.data import page_data

if TYPE_CHECKING:
    from genie_sim.recording.results import Run

NAME = "report.html"
REPLAY = (
    "replay_model.js", "replay_canvas.js", "replay_street.js", "replay_strips.js", "story.js", "replay_controls.js"
)  # fmt: skip
DASH_PX = 3  # a unit of the figures' dashes
LINES = 32  # that differ in colour or dashes


def write(path: Path, run: "Run", start_ns: int = 0) -> None:
    """Writes the page about ``run``. A long run is replayed from ``start_ns`` on, as far as the page's size allows.

    Raises ``UserError`` if ``path`` cannot be written.
    """
    write_text(path, page(run, start_ns))


def write_text(path: Path, text: str) -> None:
    """Beside and renamed. Raises ``UserError``."""
    with atomic_write(path) as beside:
        beside.write_text(text, encoding="utf-8")


def page(run: "Run", start_ns: int = 0) -> str:
    """The text of the page about ``run``. Raises ``UserError`` for one from a folder that this version did not write."""
    with provenance.of_this_version(run.folder):
        elsewhere = "The numbers are also in metrics.json and summary.md beside it."
        title, scripts = (
            f"{run.name}, run {run.run_id}",
            ("parts.js", *REPLAY, "many.js", "fleet.js", "run.js"),
        )
        return assemble("run.html", scripts, title, page_data(run, start_ns), elsewhere)


def assemble(
    content: str,
    scripts: Sequence[str],
    title: str,
    data: Mapping[str, Any],
    elsewhere: str,
    pictures: bool = False,
) -> str:
    """A page from its parts. ``elsewhere`` says where a reader without JavaScript finds the same. The page's policy
    allows its own script and style, and ``pictures`` that are in its data."""
    look = _palette() + _part("page.css")
    script = '"use strict";\n' + "\n".join(map(_part, ("base.js", "charts.js", *scripts)))
    allowed = f"script-src {_source(script)}; style-src {_source(look)}{'; img-src data:' if pictures else ''}"
    parts = {
        "policy": f"default-src 'none'; {allowed}; base-uri 'none'",
        "title": escape(title),
        "style": look,
        "elsewhere": escape(elsewhere),
        "content": _part(content),
        "data": as_json({"palette": len(style.COLOURS), "lines": LINES, **data}),
        "script": script,
    }
    return re.sub("%([a-z]+)%", lambda mark: parts[mark[1]], _part("shell.html"))


def _palette() -> str:
    """The colours of methods as variables ``--method-0`` and so on, of hosts as ``--host-0``; methods' lines as classes
    ``m0`` and so on, those of hosts ``h0``, and parts of the time ``part-0``."""
    colours = len(style.COLOURS)
    light, dark = (
        ":root{"
        + "".join(f"--{of}-{i}:{one};" for of, all in named.items() for i, one in enumerate(all))
        + "}"
        for named in (
            {"method": style.COLOURS, "host": style.HOSTS},
            {"method": style.DARK_COLOURS, "host": style.DARK_HOSTS},
        )
    )
    lines = (
        f".m{i}{{--c:var(--method-{i % colours});stroke-dasharray:{_dashes(i)}}}"
        for i in range(LINES)
    )
    parts = (
        f".part-{i}{{fill:{look['facecolor']}}}" for i, (_, look) in enumerate(style.PARTS.values())
    )
    hosts = (f".h{i}{{--c:var(--host-{i})}}" for i in range(len(style.HOSTS)))
    return "\n".join(
        [light, f"@media (prefers-color-scheme: dark){{{dark}}}", *lines, *parts, *hosts, ""]
    )


def _dashes(position: int) -> str:
    dashes = style.method_line(position)["linestyle"]
    return (
        "none" if dashes == style.SOLID else " ".join(f"{DASH_PX * part:g}" for part in dashes[1])
    )


def as_json(value: Any) -> str:
    """JSON that may stand inside a ``<script>`` element: no text in it can end the element or begin a comment."""
    text = json.dumps(value, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _source(text: str) -> str:
    """What allows exactly this text in a Content-Security-Policy."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


def _part(name: str) -> str:
    return resources.files(__package__).joinpath(name).read_text(encoding="utf-8")
