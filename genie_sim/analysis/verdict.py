"""What a comparison comes to, in a sentence for each arm: in what it is better or worse, by how
much, and how sure that is.
"""

from collections.abc import Sequence

from genie_sim.analysis.compare import Arm, ComparedRuns, Difference
from genie_sim.analysis.metric import HEADLINE
from genie_sim.analysis.registry import shown
from genie_sim.base.text import number_text


def verdicts(comparison: ComparedRuns) -> list[str]:
    """A sentence for each arm that is compared with another."""
    sentences = []
    for arm in comparison.arms:
        rows = {
            row.metric: row
            for row in comparison.rows
            if row.arm is arm and row.difference is not None
        }
        if headlines := [rows[name] for name in shown(HEADLINE, rows)]:
            sentences.append(_sentence(arm, headlines))
    return sentences


PHRASES = {  # of a verdict: how a part of the sentence begins, and what stands before the reference
    "better": ("better", "than"),
    "worse": ("worse", "than"),
    "different": ("different", "from"),
    "unclear": ("not clearly different", "from"),
    "": ("different, without an interval,", "from"),
    "negligible": ("negligibly different", "from"),
    "equal": ("the same", "as"),
}


def _sentence(arm: Arm, rows: Sequence[Difference]) -> str:
    parts: list[str] = []
    named = ""  # the reference that the sentence has named last
    for verdict, (begin, before) in PHRASES.items():
        of_kind = [row for row in rows if row.verdict == verdict]
        for reference in dict.fromkeys(row.reference for row in of_kind):
            alike = [row for row in of_kind if row.reference == reference]
            to = "" if reference == named else f" {before} {reference}"
            parts.append(f"{begin}{to} in {_joined([_difference(row) for row in alike])}")
            named = reference
    if len(arm.against) > 1:
        parts.append("each against the best baseline")
    sure = next((row for row in rows if row.low is not None and row.verdict != "equal"), None)
    if sure is not None:
        parts.append(f"95 % intervals of paired differences, over {sure.n} {sure.by}")
    return f"{arm.title} is {'; '.join(parts)}."


def _joined(texts: Sequence[str]) -> str:
    return ", ".join(texts[:-1]) + (" and " if len(texts) > 1 else "") + texts[-1]


def _difference(row: Difference) -> str:
    """``first answer, mean (-340 ms, -342 to -338)``; the title alone of what is the same."""
    info = row.about
    if row.difference is None or row.verdict == "equal":
        return info.title
    unit = "percentage points" if info.unit == "%" else info.unit
    text = f"{number_text(info.factor * row.difference, sign='+')} {unit}".rstrip()
    if row.low is not None and row.high is not None:
        low, high = (number_text(info.factor * end, sign="+") for end in (row.low, row.high))
        text += f", {low} to {high}"
    return f"{info.title} ({text})"
