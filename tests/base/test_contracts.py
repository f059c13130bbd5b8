"""What a class of the user's own may return: each kind of value at its borders."""

from __future__ import annotations

import math
import sys
from typing import Any

import numpy as np
import pytest

from genie_sim.base import contracts
from genie_sim.base.contracts import Contract, require
from genie_sim.base.errors import UserError

HUGE = 10**400  # no float holds it
VALUES: dict[str, tuple[list[Any], list[Any]]] = {  # right ones and wrong ones
    "METHOD": ([len, lambda: 0], [None, "len"]),
    "WHOLE": ([0, 7, np.int64(3), 2**62 - 1], [-1, 2**62, 1.0, True, "1", None]),
    "POSITIVE": (
        [1e-300, 2, np.float64(0.5), sys.float_info.max],
        [0, -1, math.nan, math.inf, True, "1", 1j, HUGE, None],
    ),
    "TEXT": (["a"], ["", b"a", None, 1]),
    "BOOLEAN": ([True, False], [0, 1, None, "yes", np.bool_(True)]),
    "SHARE": ([0, 1, 0.5], [-1e-9, 1.0000001, True, math.nan]),
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
