"""Blocks of commands in Markdown and what they show."""

from __future__ import annotations

import re
from difflib import SequenceMatcher

# Done by whoever runs this test: getting the project, installing it, and the tests themselves.
SET_UP = re.compile(
    r"^(git clone|cd genie-sim|python3? -m (venv|pip|pytest)|pip |source |\. |(\S*/)?\.ci/run)"
)


def without_set_up(command: str) -> str:
    """What is left of ``python -m venv .venv && . .venv/bin/activate && genie-sim run town``: the
    last part.
    """
    return " && ".join(part for part in command.split(" && ") if not SET_UP.match(part.strip()))


def script(lines: tuple[str, ...]) -> str:
    """The commands of a ``bash`` block, without those that set the project up."""
    commands = "\n".join(lines).replace("\\\n", " ").splitlines()
    return "\n".join(filter(None, map(without_set_up, commands)))


def session(lines: tuple[str, ...]) -> list[tuple[str, list[str]]]:
    """The commands of a ``console`` block, each with the output shown below it."""
    shown: list[tuple[str, list[str]]] = []
    for line in lines:
        if shown and shown[-1][0].endswith("\\") and not shown[-1][1]:
            shown[-1] = (shown[-1][0][:-1] + line.strip().removeprefix("> "), [])
        elif line.startswith("$ "):
            shown.append((line[2:], []))
        else:
            assert shown, f"a console block begins with '$ command', not {line!r}"
            shown[-1][1].append(line)
    return [
        (without_set_up(command), output) for command, output in shown if without_set_up(command)
    ]


CHANGING = (  # from one run to the next; shown as ``...``
    (re.compile(r"(?<=-)[0-9a-f]{12}\b"), "..."),
    (re.compile(r"[\d.,]+(?= s simulated)"), "..."),
)


def abbreviated(shown: list[str], printed: str) -> list[str]:
    """The printed lines, left out where ``shown`` leaves lines out: of the others those that are
    most alike. All of them where that does not match.
    """
    waiting = [line.rstrip() for line in printed.strip("\n").splitlines()]
    found: list[str] = []
    for line in "\n".join(shown).strip("\n").splitlines():
        if line.strip() == "..." or not waiting:
            found.append(line)
            continue
        alike = [SequenceMatcher(None, line, other).ratio() for other in waiting]
        place = alike.index(max(alike))
        if "..." in line:
            waiting[place] = _without_changing(waiting[place])
        found.append(waiting[place])
        del waiting[: place + 1]
    return found if matches(found, printed) else printed.rstrip().splitlines()


def _without_changing(line: str) -> str:
    for pattern, instead in CHANGING:
        line = pattern.sub(instead, line)
    return line


def matches(shown: list[str], printed: str) -> bool:
    """Whether ``printed`` is what is shown, ``...`` being anything; spaces at the ends of lines do
    not count.
    """
    pattern = ""
    for line in "\n".join(shown).strip().splitlines():
        if line.strip() == "...":
            pattern += r"(?:.*\n)*"
        else:
            pattern += ".*".join(re.escape(part) for part in line.rstrip().split("...")) + "\n"
    text = "".join(f"{line.rstrip()}\n" for line in printed.strip().splitlines())
    return re.fullmatch(pattern, text) is not None
