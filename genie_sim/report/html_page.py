"""``report.html``: one page about a run or an evaluation, for a browser. It needs no
network, no other file.

The same results give the same bytes. Everything that the page shows is in it as JSON; nothing of it
is ever taken for HTML or for a script, and the page's own security policy forbids it to load or to
send anything.
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
from genie_sim.base.paths import atomic_write
from genie_sim.record import provenance
from genie_sim.report.data import page_data

if TYPE_CHECKING:
    from genie_sim.record.results import Run
    from genie_sim.report.replay_pictures import Pictures

NAME = "report.html"
REPLAY = (
    "replay_model.js",
    "replay_canvas.js",
    "replay_street.js",
    "replay_camera.js",
    "replay_hosts.js",
    "replay_difference.js",
    "replay_strips.js",
    "story.js",
    "replay_tables.js",
    "replay_address.js",
    "replay_controls.js",
)
DASH_PX = 3  # a unit of the figures' dashes
LINES = 48  # that differ in colour or dashes


def write(path: Path, run: "Run", start_ns: int = 0, pictures: "Pictures | None" = None) -> None:
    """Writes the page about ``run``. A long run is replayed from ``start_ns`` on, as far as the
    page's size allows. ``pictures`` are shown under what cars hold.

    Raises ``UserError`` if ``path`` cannot be written.
    """
    write_text(path, page(run, start_ns, pictures))


def write_text(path: Path, text: str) -> None:
    """Beside and renamed. Raises ``UserError``."""
    with atomic_write(path) as beside:
        beside.write_text(text, encoding="utf-8")


def page(run: "Run", start_ns: int = 0, pictures: "Pictures | None" = None) -> str:
    """The text of the page about ``run``. Raises ``UserError`` for one from a folder that this
    version did not write.
    """
    with provenance.of_this_version(run.folder):
        elsewhere = "The numbers are also in metrics.json and summary.md beside it."
        title, scripts = (
            f"{run.title}, run {run.run_id}",
            ("parts.js", *REPLAY, "many.js", "fleet.js", "run.js"),
        )
        data = page_data(run, start_ns, pictures)
        source = None if pictures is None else "data:" if pictures.copied else "file:"
        return assemble("run.html", scripts, title, data, elsewhere=elsewhere, pictures=source)


def assemble(
    content: str,
    scripts: Sequence[str],
    title: str,
    data: Mapping[str, Any],
    *,
    elsewhere: str,
    pictures: str | None = None,
) -> str:
    """A page from its parts. Its security policy allows its own script and style alone.

    Parameters
    ----------
    content, scripts : str, sequence of str
        Names of files of this folder: the page's HTML, and its scripts in their order.
    title : str
        Of the page.
    data : mapping
        What the scripts show, as plain JSON values.
    elsewhere : str
        Tells a reader without JavaScript where the same numbers are.
    pictures : str, optional
        Where the page's pictures are, if it shows any: ``data:``, in the page, or ``file:``.
    """
    look = _palette() + _part("page.css")
    script = '"use strict";\n' + "\n".join(map(_part, ("base.js", "charts.js", *scripts)))
    allowed = f"script-src {_source(script)}; style-src {_source(look)}"
    if pictures is not None:
        allowed += f"; img-src {pictures}"
    sizes = {"palette": len(style.COLOURS), "hosts": len(style.HOSTS), "lines": LINES}
    parts = {
        "policy": f"default-src 'none'; {allowed}; base-uri 'none'",
        "title": escape(title),
        "style": look,
        "elsewhere": escape(elsewhere),
        "content": _part(content),
        "data": as_json({**sizes, **data}),
        "script": script,
    }
    return re.sub("%([a-z]+)%", lambda mark: parts[mark[1]], _part("shell.html"))


def _palette() -> str:
    """The colours of methods as variables ``--method-0`` and so on, of hosts as ``--host-0``;
    methods' lines as classes ``m0`` and so on, those of hosts ``h0``, and parts of the time
    ``part-0``.
    """
    colours = len(style.COLOURS)
    light = _variables(style.COLOURS, style.HOSTS)
    dark = _variables(style.DARK_COLOURS, style.DARK_HOSTS)
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


def _variables(methods: Sequence[str], hosts: Sequence[str]) -> str:
    """The rule of CSS that names the colours of methods and of hosts."""
    variables = [f"--method-{place}:{colour};" for place, colour in enumerate(methods)]
    variables += [f"--host-{place}:{colour};" for place, colour in enumerate(hosts)]
    return f":root{{{''.join(variables)}}}"


def _dashes(look: int) -> str:
    dashes = style.method_line(look)["linestyle"]
    return (
        "none" if dashes == style.SOLID else " ".join(f"{DASH_PX * part:g}" for part in dashes[1])
    )


def as_json(value: Any) -> str:
    """JSON that may stand inside a ``<script>`` element: no text in it can end the element or begin
    a comment.
    """
    text = json.dumps(value, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _source(text: str) -> str:
    """What allows exactly this text in a Content-Security-Policy."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


def _part(name: str) -> str:
    return resources.files(__package__).joinpath(name).read_text(encoding="utf-8")
