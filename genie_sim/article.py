"""Results of every kind for a paper: figures, tables, and a whole article in two columns.

A result folder is that of a run, of several seeds, of a sweep or of the evaluation; several folders
are a comparison.
"""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from genie_sim.analysis import compare_tables, latex, screen, summary, text_table
from genie_sim.analysis import figures as of_runs
from genie_sim.analysis.compare import ComparedRuns, compare, compared
from genie_sim.analysis.registry import METRICS
from genie_sim.analysis.seed_runs import ABOUT, SeedRuns, is_seeds_folder, load, with_methods
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
EVALUATION_TITLE = "The paper's evaluation, simulated"
NAME = "article.tex"
CLASSES = {  # by publisher: the class with its options, and the widths of a column and of a page
    "ieee": (r"\documentclass[conference]{IEEEtran}", "column", "page"),
    # balanced columns of the last page lose floats that have not found their place before
    "acm": (r"\documentclass[sigconf,nonacm,balance=false]{acmart}", "acm-column", "acm-page"),
}
# the figures of an article in their order, and which are over both columns; all others stay out
OF_RUNS = {
    "latency_accuracy": False,
    "latency_cdf": False,
    "differences": True,
    "time_parts": False,
}
OF_EVALUATION = {
    "image_reuse": False,
    "object_reuse": False,
    "latency_cdf_of_published": True,
    "case_study": True,
    "worth": False,
}
FIRST = 2  # figures on the first page
FITTING = r"width=\linewidth,height=0.85\textheight,keepaspectratio"
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
    from genie_sim.study.sweep_table import SweepPlots

    width_in = None if width is None else WIDTHS[width]
    if len(folders) > 1:
        return comparison.figures(_compared(folders, allow_changed), width_in)
    (folder,) = folders
    if _is_evaluation(folder):
        from genie_sim.paper import paper_figures

        return paper_figures.of_evaluation(folder, width_in, allow_changed)
    if _is_sweep(folder):
        return SweepPlots.read(folder, allow_changed).figures(width_in or PAGE_IN)
    run = load(folder, allow_changed=allow_changed)
    with provenance.of_this_version(folder):
        return of_runs.of_run(run, width_in)


def table(
    folders: Sequence[Path],
    format: str,
    methods: Sequence[str] = (),
    allow_changed: bool = False,
) -> str:
    """The numbers of results in one of ``text_table.FORMATS``, of all ``methods`` or of these in
    this order. Raises ``UserError``.
    """
    from genie_sim.paper import verdict_table
    from genie_sim.study import printed

    text_table.checked(format)
    if len(folders) > 1:
        return compare_tables.text(_compared(folders, allow_changed, methods), format)
    (folder,) = folders
    if _is_evaluation(folder):
        if methods:
            raise UserError(f"--methods: {folder} is an evaluation: its table is one of claims")
        return verdict_table.printed(provenance.read_json(folder / EVALUATION), format)
    if _is_sweep(folder):
        return printed.table_of(folder, format, methods, allow_changed)
    run = with_methods(load(folder, allow_changed=allow_changed), methods)
    with provenance.of_this_version(folder):
        return summary.table(run, format)


def write(
    folders: Sequence[Path], out: Path, publisher: str = "ieee", allow_changed: bool = False
) -> list[Path]:
    """Writes an article in two columns into a folder: ``article.tex``, its tables and figures.

    The text says what was run, what came out with its intervals, and what each metric means; the
    rest is for the author. Raises ``UserError``.
    """
    document_class, column, page = CLASSES[publisher]
    results = table(folders, "latex", allow_changed=allow_changed)
    chosen = _chosen(folders, (column, page), allow_changed)
    floats = [_figure(name, figure) for name, figure in chosen.items()]
    parts = [
        document_class,
        PREAMBLE,
        r"\begin{document}",
        rf"\title{{{latex.escaped(_title(folders, allow_changed))}}}",
        r"\author{Author}",
        *_front(folders, publisher, allow_changed),
        *floats[:FIRST],
        _references(results, list(chosen)),
        r"\input{tables}",
        *floats[FIRST:],
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
    """The figures of an article in their order: of a sweep all, of other results a choice."""
    narrow, wide = (figures(folders, width, allow_changed) for width in widths)
    if _is_sweep(folders[0]):
        return wide
    choice = OF_EVALUATION if _is_evaluation(folders[0]) else OF_RUNS
    return {
        name: (wide if both_columns else narrow)[name]
        for name, both_columns in choice.items()
        if name in narrow
    }


def _compared(
    folders: Sequence[Path], allow_changed: bool, methods: Sequence[str] = ()
) -> ComparedRuns:
    return compare([load(folder, allow_changed=allow_changed) for folder in folders], methods)


def _is_evaluation(folder: Path) -> bool:
    return (folder / EVALUATION).is_file()


def _is_sweep(folder: Path) -> bool:
    return (folder / ABOUT).is_file() and not is_seeds_folder(folder)


def _runs(folders: Sequence[Path], allow_changed: bool) -> list[Run | SeedRuns]:
    if any(_is_sweep(folder) or _is_evaluation(folder) for folder in folders):
        return []
    return [load(folder, allow_changed=allow_changed) for folder in folders]


def _title(folders: Sequence[Path], allow_changed: bool) -> str:
    runs = _runs(folders, allow_changed)
    if _is_evaluation(folders[0]):
        return EVALUATION_TITLE
    return ", ".join(dict.fromkeys(run.title for run in runs)) or folders[0].resolve().name


def _front(folders: Sequence[Path], publisher: str, allow_changed: bool) -> list[str]:
    """The abstract, what was run, and what came out, in sentences."""
    from genie_sim.paper import verdict_table
    from genie_sim.study import printed

    sentences: list[str] = []
    setup: list[str] = []
    if _is_evaluation(folders[0]):
        sentences = verdict_table.result_sentences(folders[0])
        setup = verdict_table.setup_sentences(folders[0])
    elif _is_sweep(folders[0]):
        setup = printed.setup_sentences(folders[0], allow_changed)
    elif runs := _runs(folders, allow_changed):
        sentences = verdicts(compared(runs) if len(runs) == 1 else compare(runs))
        for run in runs:
            description = str(run.runs[0].facts["scenario"]["description"] or "")
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
            rf"\includegraphics[{FITTING}]{{figures/{name}.pdf}}",
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
