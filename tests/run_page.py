"""Runs a page of the documentation from top to bottom, in the current folder, as its reader would.

- A block with a ``title`` is a file: it is written, not run. ``` ```yaml title="town.yaml" ```
- ``python`` blocks share one namespace; a ``text`` block right below one shows what it prints.
- A ``bash`` block is one script. In a ``console`` block each ``$ command`` is run, and the lines
  below it are compared with its output: a line ``...`` stands for any lines, ``...`` within a line
  for any text.
- ``<!-- not run: reason -->`` above a block leaves it out, ``<!-- needs VARIABLE -->`` where that
  is not set.

``python tests/run_page.py PAGE`` tells where the page lies; with ``--accept`` it shows instead what
was printed, for the author to look at and commit.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import subprocess
import sys
import traceback
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from tests.docs.blocks import abbreviated, matches, script, session

FENCE = re.compile(r'(?P<indent> *)```(?P<language>\w*)(?: title="(?P<title>[^"]+)")?(?: .*)?')
LONGEST_BLOCK_S = 300


@dataclass(frozen=True)
class Block:
    """A fenced block; ``first`` is the index of its first line in the page, ``indent`` the spaces
    before each.
    """

    language: str
    title: str | None
    first: int
    lines: tuple[str, ...]
    not_run: str | None
    indent: str

    @property
    def text(self) -> str:
        return "\n".join(self.lines) + "\n"


def blocks(page: str) -> Iterator[Block]:
    """The fenced blocks of a Markdown text, in order."""
    lines = page.splitlines()
    not_run = None
    index = 0
    while index < len(lines):
        line = lines[index]
        index += 1
        if comment := re.fullmatch(r"\s*<!-- not run: (.+) -->", line):
            not_run = comment[1]
        elif needs := re.fullmatch(r"\s*<!-- needs (\w+) -->", line):
            not_run = None if os.environ.get(needs[1]) else f"{needs[1]} is not set"
        elif fence := FENCE.fullmatch(line):
            first, indent = index, fence["indent"]
            while lines[index].strip() != "```":
                index += 1
            content = tuple(one.removeprefix(indent) for one in lines[first:index])
            index += 1
            yield Block(fence["language"], fence["title"], first, content, not_run, indent)
            not_run = None
        elif line.strip():
            not_run = None


class Reader:
    """Follows one page; ``shown`` holds what the blocks that show an output should have shown."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.problems: list[str] = []
        self.shown: dict[int, tuple[Block, list[str]]] = {}
        self._names: dict[str, object] = {"__name__": "__main__"}
        self._printed = ""

    def read(self, page: str) -> None:
        for block in blocks(page):
            if block.not_run:
                continue
            if block.title is not None:
                Path(block.title).parent.mkdir(parents=True, exist_ok=True)
                Path(block.title).write_text(block.text, encoding="utf-8")
            elif block.language == "python":
                if not self._python(block):
                    return  # what follows builds on it
            elif block.language == "text":
                if not matches(list(block.lines), self._printed):
                    instead = abbreviated(list(block.lines), self._printed)
                    self._wrong(block, "prints", self._printed, instead)
            elif block.language == "bash":
                status, printed = shell(script(block.lines))
                if status:
                    self._wrong(block, "fails", printed)
                    return
            elif block.language == "console":
                self._console(block)

    def _python(self, block: Block) -> bool:
        printed = io.StringIO()
        try:
            with contextlib.redirect_stdout(printed):
                exec(compile("\n" * block.first + block.text, self.name, "exec"), self._names)
        except Exception:
            self._wrong(block, "fails", traceback.format_exc())
            return False
        self._printed = printed.getvalue()
        return True

    def _console(self, block: Block) -> None:
        lines: list[str] = []
        wrong, fails = "", False
        for command, shown in session(block.lines):
            status, printed = shell(command)
            an_error_is_shown = any(line.startswith("genie-sim: ") for line in shown)
            fails |= (status != 0) != an_error_is_shown
            if fails or not matches(shown, printed):
                wrong += f"$ {command}  [status {status}]\n{printed}"
                shown = abbreviated(shown, printed)
            lines += [f"$ {command}", *(line.rstrip() for line in shown)]
        if wrong:
            self._wrong(block, "prints", wrong, None if fails else lines)

    def _wrong(
        self, block: Block, what: str, printed: str, instead: list[str] | None = None
    ) -> None:
        self.problems.append(
            f"{self.name}:{block.first + 1}: {block.language} block {what}:\n{printed}"
        )
        if instead is not None:
            self.shown[block.first] = (block, instead)


def shell(commands: str) -> tuple[int, str]:
    """Exit status and what is printed, in the manner of a terminal of 100 columns without
    colours.
    """
    ran = subprocess.run(
        ["bash", "-euo", "pipefail", "-c", commands],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=LONGEST_BLOCK_S,
        env={
            **os.environ,
            "COLUMNS": "100",
            "NO_COLOR": "1",
            "TERM": "dumb",
            "GENIE_SIM_PROGRESS": "off",
        },
    )
    return ran.returncode, ran.stdout


def accepted(page: str, reader: Reader) -> str:
    """The page with what was printed in place of what it shows."""
    lines = page.splitlines()
    for first, (block, instead) in sorted(reader.shown.items(), reverse=True):
        lines[first : first + len(block.lines)] = [
            (block.indent + line).rstrip() for line in instead
        ]
    return "\n".join(lines) + "\n"


def main(arguments: list[str]) -> int:
    accept = "--accept" in arguments
    (page,) = (Path(one) for one in arguments if one != "--accept")
    sys.path.insert(0, "")  # files that the page has written can be imported
    text = page.read_text(encoding="utf-8")
    reader = Reader(page.name)
    reader.read(text)
    if accept and reader.shown:
        page.write_text(accepted(text, reader), encoding="utf-8")
    sys.stdout.write("".join(f"{problem}\n" for problem in reader.problems))
    return bool(reader.problems)


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
