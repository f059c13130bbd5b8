"""Numbers and names as text."""

import math

import pytest

from genie_sim.base.text import (
    finite,
    natural_key,
    number_text,
    one_line,
    percent_text,
    significant,
)


@pytest.mark.parametrize(
    ("value", "digits", "sign", "text"),
    [
        (0.0, 3, "", "0"),
        (0.071342, 3, "", "0.0713"),
        (46.249, 3, "", "46.2"),
        (999.4, 3, "", "999"),
        (999.5, 3, "", "1,000"),
        (-1234.4, 3, "", "-1,234"),
        (1234567.0, 3, "+", "+1,234,567"),
        (0.5, 3, "+", "+0.5"),
        (99.4, 2, "", "99"),
        (99.6, 2, "", "100"),
        (0.00001234, 2, "", "1.2e-05"),
    ],
)
def test_number_has_its_digits_and_no_exponent_when_it_is_large(value, digits, sign, text):
    assert number_text(value, digits, sign) == text


def test_share_as_percentage():
    assert percent_text(0.0713, digits=2) == "7.1 %"
    assert percent_text(1.0, digits=2) == "100 %"
    assert percent_text(-0.1234) == "-12.3 %"


def test_rounded_numbers_keep_their_significant_digits():
    assert significant(1 / 3, 4) == 0.3333
    assert significant(123456789.0, 3) == 123000000.0
    assert finite(2 / 3) == 0.666667
    assert finite(math.nan) is finite(math.inf) is finite(None) is None


def test_names_sort_by_their_numbers():
    assert sorted(["car10", "car2", "car", "bus3"], key=natural_key) == [
        "bus3",
        "car",
        "car2",
        "car10",
    ]


def test_control_characters_are_escaped():
    assert one_line("a\nb\x1b[31m é \ud800") == "a\\nb\\x1b[31m é \\ud800"
