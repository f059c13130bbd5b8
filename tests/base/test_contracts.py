"""What a class of the user's own may return: each kind of value at its borders."""

from __future__ import annotations

import math
import sys
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from genie_sim.base import contracts
from genie_sim.base.contracts import Checked, Contract, require
from genie_sim.base.errors import UserError
from genie_sim.core.messages import (
    Detections,
    Expired,
    Forgotten,
    Header,
    ImageLookup,
    LookEvent,
    NewestLook,
    ObjectLookups,
    Publish,
)
from genie_sim.runs.own_classes import EFFECTS

HUGE = 10**400  # no float holds it
VALUES: dict[str, tuple[list[Any], list[Any]]] = {  # right ones and wrong ones
    "METHOD": ([len, lambda: 0], [None, "len"]),
    "WHOLE": ([0, 7, np.int64(3), 2**62 - 1], [-1, 2**62, 1.0, True, "1", None]),
    "NUMBER": (
        [0, -1.5, sys.float_info.max, -sys.float_info.max],
        [math.nan, math.inf, -math.inf, True, "1", 1j, HUGE, None],
    ),
    "POSITIVE": ([1e-300, 2, np.float64(0.5)], [0, -1, math.nan, math.inf, True, "1"]),
    "TEXT": (["a"], ["", b"a", None, 1]),
    "TEXTS": ([(), ["a"], ("a", "b")], ["ab", ("a", 1), {"a"}, None]),
    "BOOLEAN": ([True, False], [0, 1, None, "yes", np.bool_(True)]),
    "SHARE": ([0, 1, 0.5], [-1e-9, 1.0000001, True, math.nan]),
    "HASHABLE": ([1, "a", (1, 2), None], [[], {}, set()]),
    "MAPPING": ([{}, {"a": 1}], [[], None]),
    "SEQUENCE": ([[1], (0,), range(2)], [[], (), "ab", b"ab", {1}, None]),
    "ITERABLE": ([[], "ab", iter(())], [None, 1]),
}


@pytest.mark.parametrize("name", VALUES)
def test_a_contract_holds_for_right_values_alone(name: str):
    contract: Contract = getattr(contracts, name)
    right, wrong = VALUES[name]
    for value in right:
        assert contract.holds(value), value
        assert require("link model 'm:C'", "delay_ns()", value, contract) is value
    for value in wrong:
        assert not contract.holds(value), value
        with pytest.raises(UserError, match=f"but must be {contract.expected}$"):
            require("link model 'm:C'", "delay_ns()", value, contract)
    or_none = contracts.optional(contract)
    assert or_none.holds(None) and or_none.holds(right[0])
    assert not any(or_none.holds(value) for value in wrong if value is not None)
    assert or_none.expected == f"{contract.expected}, or None"


def test_every_contract_is_tested_here():
    known = {name for name, value in vars(contracts).items() if isinstance(value, Contract)}
    assert known == {*VALUES}


def test_a_checked_object_is_the_own_one_but_for_what_its_methods_return():
    own = SimpleNamespace(share=lambda at, *, scale=1.0: at * scale, name="radio")
    checked = Checked(own, "link model 'm:C'", {"share": contracts.SHARE})
    assert checked.name == "radio" and checked.share(0.5, scale=2) == 1.0
    checked.name = "other"
    assert own.name == "other", "what is set is set on the own object"
    with pytest.raises(UserError, match=r"^link model 'm:C': share\(\) is 4, but must be a number"):
        checked.share(2, scale=2)
    with pytest.raises(AttributeError):
        _ = checked.missing
    with pytest.raises(UserError, match=r"^link model 'm:C': draw is None, but must be a method$"):
        Checked(own, "link model 'm:C'", {"draw": contracts.NUMBER})


def test_effects_are_publications_and_every_kind_of_observation():
    header = Header(1, "camera_02", "car1")
    answer = Detections(header, ())
    right = [
        Publish("/objects", answer, None),
        ImageLookup(header, "hit", "client", 3),
        ObjectLookups(header, "boost", 2, 1, 0, 0.0, 4),
        Expired(header),
        Forgotten(()),
        LookEvent(header, "own", "sent"),
        NewestLook(header, 5),
    ]
    for effect in right:
        assert EFFECTS.holds([effect]) and EFFECTS.holds((*right, effect)), effect
    wrong = [Publish(3, answer, None), Publish("/objects", "an answer", None), header, None]
    for effect in wrong:
        assert not EFFECTS.holds([*right, effect]), effect
    assert not EFFECTS.holds(right[0]) and not EFFECTS.holds(None)
