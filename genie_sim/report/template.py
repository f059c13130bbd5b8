"""The one template of all pages: ``report.html`` of runs, seeds, sweeps, comparisons and the
evaluation. A page needs no network and no other file.

The same results give the same bytes. A page is read without JavaScript, but for its replay; its
security policy forbids it to load or to send anything, and allows its own script and style alone.
"""

import base64
import hashlib
import json
import re
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

from genie_sim.analysis import renderers, style
from genie_sim.analysis.result_table import ResultTable
from genie_sim.base.paths import OutputKind, atomic_write
from genie_sim.version import VERSION

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NAME = "report.html"
PAGE = OutputKind("page of genie-sim", rb"<!DOCTYPE html>.*default-src 'none'; script-src 'sha256-")
_IMPORT = re.compile(r'^import (\{[^}]*\}) from "\./(\w+)\.js";$', re.MULTILINE)
_EXPORT = re.compile(r"^export (?=(?:async )?(?:function|class|const) (\w+))", re.MULTILINE)


@dataclass(frozen=True)
class Section:
    """A part of a page.

    Parameters
    ----------
    title : str
        Its heading, and the text of the way to it.
    parts : sequence of str
        Pieces of HTML, as ``table``, ``listed``, ``note`` and ``figures`` give them.
    folded : bool
        Whether it opens on a click.
    """

    title: str
    parts: Sequence[str]
    folded: bool = False

    @property
    def name(self) -> str:
        """What addresses call it: ``#all-tables``."""
        return re.sub("[^a-z0-9]+", "-", self.title.lower()).strip("-")

    def text(self) -> str:
        """It as HTML."""
        heading = f'<h2 id="h-{self.name}">{escape(self.title)}</h2>'
        content = "\n".join(self.parts)
        if self.folded:
            content = f"<details><summary>{heading}</summary>\n{content}</details>"
        else:
            content = f"{heading}\n{content}"
        return (
            f'<section id="{self.name}" aria-labelledby="h-{self.name}">\n{content}\n</section>\n'
        )


@dataclass(frozen=True)
class Page:
    """A page.

    Parameters
    ----------
    kind : str
        What it is about: ``one run``.
    name : str
        Its title.
    sections : sequence of Section
        Those without parts are left out.
    origin : str
        What the page was made from, and where more is.
    about : sequence of str
        Sentences below the title.
    notes : sequence of str
        At the end of the page.
    title : str
        Of the window; by default the name.
    replay : mapping, optional
        What the replay shows, as plain JSON values.
    """

    kind: str
    name: str
    sections: Sequence[Section]
    origin: str
    about: Sequence[str] = ()
    notes: Sequence[str] = ()
    title: str = ""
    replay: Mapping[str, Any] | None = None

    def text(self) -> str:
        """The page as HTML."""
        sections = [section for section in self.sections if any(section.parts)]
        look = _palette() + part("page.css")
        texts = scripts("page") | (scripts("replay") if self.replay is not None else {})
        script = "\n".join(['"use strict";', *texts.values()])
        made = f"Made by genie-sim {VERSION} from {self.origin}"
        parts = {
            "policy": f"default-src 'none'; script-src {_source(script)}; "
            f"style-src {_source(look)}; img-src data:; base-uri 'none'",
            "title": escape(self.title or self.name),
            "style": look,
            "kind": escape(f"genie-sim {VERSION}, {self.kind}"),
            "name": escape(self.name),
            "about": "\n  ".join(f"<p>{escape(text)}</p>" for text in self.about),
            "ways": "".join(
                f'<a href="#{section.name}">{escape(section.title)}</a>' for section in sections
            ),
            "content": "".join(section.text() for section in sections),
            "notes": "".join(f"<li>{escape(note)}</li>" for note in [*self.notes, made]),
            "data": "" if self.replay is None else packed(self.replay),
            "script": script,
        }
        return re.sub("%([a-z]+)%", lambda mark: parts[mark[1]], part("shell.html"))


def write(path: Path, text: str) -> None:
    """Writes a page, beside and renamed. Raises ``UserError``."""
    with atomic_write(path, PAGE) as beside:
        beside.write_text(text, encoding="utf-8")


def part(name: str) -> str:
    """A file of this folder."""
    return resources.files(__package__).joinpath(name).read_text(encoding="utf-8")


def scripts(name: str) -> dict[str, str]:
    """A script of this folder, after those that it imports, by their names: each an object of what
    it exports, for a page without files has no modules.
    """
    code = part(f"{name}.js")
    texts: dict[str, str] = {}
    for _, imported in _IMPORT.findall(code):
        texts |= scripts(imported)
    exported = ", ".join(_EXPORT.findall(code))
    inside = _EXPORT.sub("", _IMPORT.sub(r"const \1 = \2;", code))
    texts[name] = f"const {name} = (() => {{\n{inside}\nreturn {{ {exported} }};\n}})();"
    return texts


def note(*texts: str) -> str:
    """Small texts, a paragraph each; nothing for empty ones."""
    return "".join(f'<p class="small">{escape(text)}</p>' for text in texts if text)


def listed(texts: Sequence[str]) -> str:
    """A list of texts; nothing for none."""
    items = "".join(f"<li>{escape(text)}</li>" for text in texts)
    return f"<ul>{items}</ul>" if items else ""


def table(results: ResultTable, filtered: bool = False) -> str:
    """A table with its title and its notes; ``filtered``: below a field that leaves only the rows
    that hold its words. Nothing for no rows.
    """
    if not results.rows:
        return ""
    title = results.title and f"<h3>{escape(results.title)}</h3>"
    inside = boxed(renderers.html_table(results), results.title or "Table")
    if filtered:
        inside = filterable(inside)
    return title + inside + note(*results.notes)


def boxed(html: str, title: str) -> str:
    """A piece of HTML that may be broader than the window."""
    return (
        f'<div class="scroll" tabindex="0" role="region" aria-label="{escape(title)}">{html}</div>'
    )


def filterable(html: str) -> str:
    """The same piece of HTML, a table, below the field that chooses its rows."""
    field = '<label>Only rows with <input type="search"></label> <output></output>'
    return f'<div class="filtered"><div class="controls">{field}</div>{html}</div>'


def figures(drawn: "Mapping[str, Figure]") -> str:
    """Figures, as sources of pictures, where scripts in them would not run; nothing for none."""
    from genie_sim.analysis.figures import svg

    if not drawn:
        return ""
    return (
        f'<div class="figures">{"".join(_figure(each, svg(each)) for each in drawn.values())}</div>'
    )


def _figure(figure: "Figure", svg: bytes) -> str:
    title = escape(str(figure.get_label()).partition("\n")[0])
    wide = ' class="wide"' if figure.get_figwidth() > style.COLUMN_IN else ""
    source = f"data:image/svg+xml;base64,{base64.b64encode(svg).decode()}"
    picture = boxed(f'<img src="{source}" alt="{title}">', "Figure")
    return f"<figure{wide}>{picture}<figcaption>{title}</figcaption></figure>"


def packed(value: Any) -> str:
    """JSON, compressed, in letters that end no element."""
    text = json.dumps(value, separators=(",", ":"), allow_nan=False)
    return base64.b64encode(zlib.compress(text.encode(), level=3)).decode()


def _palette() -> str:
    """The colours of parts of the time as classes: ``part-queueing``."""
    return "".join(f".part-{name}{{fill:{colour}}}\n" for name, (_, colour) in style.PARTS.items())


def _source(text: str) -> str:
    """What allows exactly this text in a Content-Security-Policy."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"
