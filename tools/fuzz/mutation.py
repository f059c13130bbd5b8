"""Bytes and settings, broken at random."""

from __future__ import annotations

import copy
import math
import random
from typing import Any

WORDS = (
    b"",
    b"\0",
    b"nan",
    b"-inf",
    b"1e400",
    b"9" * 400,
    b"\xff\xfe",
    b"\n",
    b" ",
    b"-1",
    b"2.5",
    b"x",
    b"<",
    b"\r\n\r\n",
    b"\xff\xff\xff\xff",
    b"\x7f\xff\xff\xff",
    b"\0" * 8,
    b"\xff" * 8,
    b"../../x",
    b"{",
    b"]",
    b"&a *a",
)
VALUES: tuple[Any, ...] = (
    None,
    True,
    False,
    0,
    -1,
    1,
    2**31,
    2**63,
    2**64,
    -(2**70),
    10**400,
    0.5,
    -0.0,
    1e-300,
    1e308,
    math.nan,
    math.inf,
    "",
    " ",
    "x",
    "nan",
    "1e400 s",
    "-1 s",
    "1 s",
    "10 MB",
    "0 Mbit/s",
    "9" * 400,
    "\0",
    "\n",
    "é\u202e",
    "=1+1",
    "/dev/null",
    "/dev/zero",
    "nowhere:Class",
    "os:system",
    "genie",
    "car1",
    "edge1",
    [],
    {},
    [[]],
    [None],
    {"": None},
    {"name": "x"},
    [1, "a"],
    "2011-11-11",
    "[x",
    "a: b",
    {"x": {"y": [{}]}},
    "car" * 1000,
)


def broken(content: bytes, rng: random.Random) -> bytes:
    """One to four changes: bytes flipped, cut out, doubled, put in, or the end cut off."""
    data = bytearray(content)
    for _ in range(rng.randint(1, 4)):
        at, length = rng.randint(0, len(data)), rng.randint(1, 40)
        what = rng.randrange(7)
        if what == 0 and data:
            data[at % len(data)] ^= 1 << rng.randrange(8)
        elif what == 1:
            del data[at : at + length]
        elif what == 2:
            data[at:at] = data[at : at + length]
        elif what == 3:
            data[at : at + length] = rng.choice(WORDS)
        elif what == 4:
            data[at:at] = rng.choice(WORDS)
        elif what == 5 and data:
            data[at % len(data)] = rng.randrange(256)
        elif rng.random() < 0.3:
            del data[at:]
    return bytes(data)


def changed(tree: Any, rng: random.Random) -> Any:
    """The same nested lists and mappings with one to three values replaced, moved, doubled, renamed
    or left out.
    """
    made = copy.deepcopy(tree)
    for _ in range(rng.randint(1, 3)):
        places = list(_places(made))
        if not places:
            return rng.choice(VALUES)
        holder, key = rng.choice(places)
        what = rng.randrange(8)
        if what == 0:
            del holder[key]
        elif what == 1 and isinstance(holder, dict):
            holder[rng.choice(("", "x", 7, None, f"{key}s", "name"))] = holder.pop(key)
        elif what == 2 and isinstance(holder, list):
            holder.append(copy.deepcopy(holder[key]))
        elif what == 3:
            holder[key] = copy.deepcopy(rng.choice(places)[0])
        elif (
            what == 4 and isinstance(holder[key], int | float) and not isinstance(holder[key], bool)
        ):
            holder[key] = holder[key] * rng.choice((-1, 0, 10, 1000))
        else:
            holder[key] = copy.deepcopy(rng.choice(VALUES))
    return made


def _places(tree: Any) -> Any:
    inside = (
        tree.items()
        if isinstance(tree, dict)
        else enumerate(tree)
        if isinstance(tree, list)
        else ()
    )
    for key, value in inside:
        yield tree, key
        yield from _places(value)
