"""Results of every kind for a paper: figures, tables, and a whole article in two columns.

A result folder is that of a run, of several seeds, of a sweep or of the evaluation; several folders
are a comparison.
"""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from genie_sim.analysis import figures as of_runs
from genie_sim.analysis import latex, screen, summary, text_table
from genie_sim.analysis.compare import ComparedRuns, compare, compared
from genie_sim.analysis.registry import METRICS
from genie_sim.analysis.seed_runs import ABOUT, SeedRuns, is_seeds_folder, load
from genie_sim.analysis.style import PAGE_IN, WIDTHS
from genie_sim.analysis.verdict import verdicts
from genie_sim.errors import UserError
from genie_sim.paths import atomic_write, usable
from genie_sim.recording import provenance
from genie_sim.recording.results import Run
from genie_sim.report import comparison
from genie_sim.version import VERSION

if TYPE_CHECKING:
    from matplotlib.figure import Figure

EVALUATION = "verdicts.json"  # a file that only an evaluation has
NAME = "article.tex"
CLASSES = {  # by publisher: the class with its options, and the widths of a column and of a page
    "ieee": (r"\documentclass[conference]{IEEEtran}", "column", "page"),
    "acm": (r"\documentclass[sigconf,nonacm]{acmart}", "acm-column", "acm-page"),
}
PRINTED = (  # of the figures of a run, those that go into an article; all others stay in the folder
    "latency_accuracy",
    "latency_cdf",
    "time_parts",
)
WIDE = "differences"  # over both columns
FIRST = ("latency_accuracy", "latency_cdf")  # on the first page
PREAMBLE = r"""\usepackage{booktabs,siunitx,graphicx}
\renewcommand{\topfraction}{0.95}
\renewcommand{\dbltopfraction}{0.95}
\renewcommand{\floatpagefraction}{0.85}
\renewcommand{\dblfloatpagefraction}{0.85}
\renewcommand{\textfraction}{0.05}
\setcounter{dbltopnumber}{3}"""


def figures(
    folders: Sequence[Path], width: str | None = None, allow_changed: bool = False
) -> "dict[str, Figure]":
    """The figures of results, by name, as wide as one of ``style.WIDTHS``; by default as fits each.
    Raises ``UserError``.
    """
    from genie_sim.study import printed

    width_in = None if width is None else WIDTHS[width]
    if len(folders) > 1:
        return comparison.figures(_compared(folders, allow_changed), width_in)
    (folder,) = folders
    if (folder / EVALUATION).is_file():
        raise UserError(
            f"{folder}: an evaluation; its figures are there, as SVG, PNG and PDF "
            f"({folder / 'figures'})"
        )
    if _is_sweep(folder):
        return printed.figures_of(folder, width_in or PAGE_IN, allow_changed)
    run = load(folder, allow_changed=allow_changed)
    with provenance.of_this_version(folder):
        return of_runs.of_run(run, width_in)


def table(folders: Sequence[Path], format: str, allow_changed: bool = False) -> str:
    """The numbers of results in one of ``text_table.FORMATS``. Raises ``UserError``."""
    from genie_sim.paper import verdict_table
    from genie_sim.study import printed

    text_table.checked(format)
    if len(folders) > 1:
        return comparison.text(_compared(folders, allow_changed), format)
    (folder,) = folders
    if (folder / EVALUATION).is_file():
        return verdict_table.printed(provenance.read_json(folder / EVALUATION), format)
    if _is_sweep(folder):
        return printed.table_of(folder, format, allow_changed)
    run = load(folder, allow_changed=allow_changed)
    with provenance.of_this_version(folder):
        return latex.tables(run) if format == "latex" else summary.table(run, format)


def write(
    folders: Sequence[Path], out: Path, publisher: str = "ieee", allow_changed: bool = False
) -> list[Path]:
    """Writes an article in two columns into a folder: ``article.tex``, its tables and figures.

    The text says what was run, what came out with its intervals, and what each metric means; the
    rest is for the author. Raises ``UserError``.
    """
    document_class, column, page = CLASSES[publisher]
    results = table(folders, "latex", allow_changed)
    chosen = _chosen(folders, (column, page), allow_changed)
    floats = [_figure(name, figure) for name, figure in chosen.items()]
    parts = [
        document_class,
        PREAMBLE,
        r"\begin{document}",
        rf"\title{{{latex.escaped(_title(folders, allow_changed))}}}",
        r"\author{Author}",
        *_front(folders, publisher, allow_changed),
        *floats[: len(FIRST)],
        _references(results, list(chosen)),
        r"\input{tables}",
        *floats[len(FIRST) :],
        *_definitions(results),
        r"\end{document}",
        "",
    ]
    paths = of_runs.save_all(chosen, out / "figures", ["pdf"])
    text = "\n".join(parts)
    with usable(out):
        out.mkdir(parents=True, exist_ok=True)
    for name, content in ((NAME, text), ("tables.tex", results)):
        with atomic_write(out / name) as beside:
            beside.write_text(content, encoding="utf-8")
        paths.append(out / name)
    return paths


def _chosen(
    folders: Sequence[Path], widths: tuple[str, str], allow_changed: bool
) -> "dict[str, Figure]":
    """The figures of an article in their order: of one run a choice, of other results all."""
    drawn = figures(folders, widths[0], allow_changed)
    of_runs_alone = len(folders) == 1 and not _is_sweep(folders[0])
    names = [name for name in drawn if not of_runs_alone or name in (WIDE, *PRINTED)]
    names.sort(key=lambda name: (name not in FIRST, name != WIDE))
    wide = figures(folders, widths[1], allow_changed) if WIDE in names else {}
    return {name: wide[name] if name == WIDE else drawn[name] for name in names}


def _compared(folders: Sequence[Path], allow_changed: bool) -> ComparedRuns:
    return compare([load(folder, allow_changed=allow_changed) for folder in folders])


def _is_sweep(folder: Path) -> bool:
    return (folder / ABOUT).is_file() and not is_seeds_folder(folder)


def _runs(folders: Sequence[Path], allow_changed: bool) -> list[Run | SeedRuns]:
    if any(_is_sweep(folder) or (folder / EVALUATION).is_file() for folder in folders):
        return []
    return [load(folder, allow_changed=allow_changed) for folder in folders]


def _title(folders: Sequence[Path], allow_changed: bool) -> str:
    runs = _runs(folders, allow_changed)
    return ", ".join(dict.fromkeys(run.title for run in runs)) or folders[0].resolve().name


def _front(folders: Sequence[Path], publisher: str, allow_changed: bool) -> list[str]:
    """The abstract, what was run, and what came out, in sentences."""
    runs = _runs(folders, allow_changed)
    sentences: list[str] = []
    setup: list[str] = []
    if runs:
        sentences = verdicts(compared(runs) if len(runs) == 1 else compare(runs))
        for run in runs:
            description = str(run.runs[0].facts["scenario"].get("description") or "")
            methods = ", ".join(method.title for method in run.methods)
            setup += filter(None, [f"{screen.header(run)}.", f"Methods: {methods}.", description])
    setup.append(f"Simulated with genie-sim {VERSION}; CITATION.cff says how to cite it.")
    abstract = [r"\begin{abstract}", _prose(setup[:1]), r"\end{abstract}"]
    title = [r"\maketitle", *abstract] if publisher == "ieee" else [*abstract, r"\maketitle"]
    return [
        *title,
        r"\section{Setup}",
        _prose(setup),
        r"\section{Results}",
        *(rf"{_prose([sentence])}\par" for sentence in sentences),
    ]


def _prose(sentences: Sequence[str]) -> str:
    """Plain text in LaTeX, with minus signs before numbers."""
    return re.sub(r"(?<![\w-])-(?=\d)", "$-$", " ".join(map(latex.escaped, sentences)))


def _references(tables: str, names: Sequence[str]) -> str:
    """Which tables and figures show it."""
    labels = re.findall(r"\\label\{(tab:[^}]*)\}", tables)
    shown = [rf"Table~\ref{{{label}}}" for label in labels]
    shown += [rf"Fig.~\ref{{fig:{latex.key(name)}}}" for name in names]
    return f"See {', '.join(shown)}."


def _figure(name: str, figure: "Figure") -> str:
    """A floating figure with its own title as the caption."""
    caption = str(figure.get_label()).partition("\n")[0]
    environment = "figure*" if figure.get_figwidth() > WIDTHS["column"] else "figure"
    return "\n".join(
        [
            rf"\begin{{{environment}}}[!t]",
            r"\centering",
            rf"\includegraphics[width=\linewidth]{{figures/{name}.pdf}}",
            rf"\caption{{{latex.escaped(caption)}.}}",
            rf"\label{{fig:{latex.key(name)}}}",
            rf"\end{{{environment}}}",
        ]
    )


def _definitions(tables: str) -> list[str]:
    """What each metric of the tables means."""
    named = [info for info in METRICS.values() if latex.escaped(info.label) in tables]
    if not named:
        return []
    meanings = dict.fromkeys(
        rf"\emph{{{latex.escaped(info.title)}}}: {latex.escaped(info.meaning)}" for info in named
    )
    return [r"\section{Definitions}", *meanings]
