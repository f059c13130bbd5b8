"""What a comparison comes to, in a sentence for each arm: in what it is better or worse, by how
much, and how sure that is.
"""

from collections.abc import Sequence

from genie_sim.analysis.compare import SEEDS, UNPAIRED, ComparedRuns, Difference
from genie_sim.analysis.metric import HEADLINE, LOWER
from genie_sim.analysis.registry import definition, shown
from genie_sim.base.text import number_text


def verdicts(comparison: ComparedRuns) -> list[str]:
    """A sentence for each arm that is compared with another."""
    titles = {arm.label: arm.title for arm in comparison.arms}
    sentences = []
    for arm in comparison.arms:
        rows = {row.metric: row for row in comparison.rows if row.arm == arm.label and row.against}
        headlines = [rows[name] for name in shown(HEADLINE, rows)]
        headlines = [row for row in headlines if row.difference is not None]
        if headlines:
            sentences.append(_sentence(titles[arm.label], titles[headlines[0].against], headlines))
    return sentences


def is_better(row: Difference) -> bool | None:
    """Whether the arm is better in this metric; ``None`` where the interval of the difference holds
    zero, or there is none.
    """
    if row.low is None or row.high is None or row.low <= 0 <= row.high:
        return None
    return (row.high < 0) == (definition(row.metric).better == LOWER)


def _sentence(arm: str, reference: str, rows: Sequence[Difference]) -> str:
    better = [row for row in rows if is_better(row) is True]
    worse = [row for row in rows if is_better(row) is False]
    equal = [row for row in rows if row.difference == row.low == row.high == 0]
    unclear = [row for row in rows if is_better(row) is None and row not in equal]
    parts = []
    if better:
        parts.append(f"better than {reference} in {_listed(better)}")
    if worse:
        than = "" if better else f" than {reference}"
        parts.append(f"worse{than} in {_listed(worse)}")
    if unclear:
        than = "" if parts else f" from {reference}"
        parts.append(f"not clearly different{than} in {_listed(unclear)}")
    if equal:
        than = "" if parts else f" as {reference}"
        titles = [definition(row.metric).title for row in equal]
        parts.append(f"the same{than} in {_joined(titles)}")
    if len(equal) == len(rows):
        return f"{arm} is {parts[0]}."
    return f"{arm} is {'; '.join(parts)}; {_sureness(rows[0])}."


def _sureness(row: Difference) -> str:
    if row.low is None:
        return "without an interval, for want of data"
    what = "seeds" if row.by.startswith(SEEDS) else "blocks of 1 s of one seed"
    if row.by.endswith(UNPAIRED):
        return (
            f"95 % intervals of differences that are not paired, over at least {row.n} {what} each"
        )
    return f"95 % intervals of paired differences, over {row.n} {what}"


def _listed(rows: Sequence[Difference]) -> str:
    return _joined([_difference(row) for row in rows])


def _joined(texts: Sequence[str]) -> str:
    return ", ".join(texts[:-1]) + (" and " if len(texts) > 1 else "") + texts[-1]


def _difference(row: Difference) -> str:
    """``first answer, mean (-340 ms, -342 to -338)``."""
    info = definition(row.metric)
    assert row.difference is not None
    unit = "percentage points" if info.unit == "%" else info.unit
    text = f"{number_text(info.factor * row.difference, sign='+')} {unit}".rstrip()
    if row.low is not None and row.high is not None:
        low, high = (number_text(info.factor * end, sign="+") for end in (row.low, row.high))
        text += f", {low} to {high}"
    return f"{info.title} ({text})"
