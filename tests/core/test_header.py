"""A header is a named tuple."""

from __future__ import annotations

import copy
import pickle

import pytest
from hypothesis import given
from hypothesis import strategies as st

from genie_sim.core.messages import Header

VALUES = st.tuples(
    st.integers(0, 3) | st.integers(), st.sampled_from(["", "left", "right"]), st.text(max_size=2)
)


@given(VALUES, VALUES)
def test_two_headers_compare_as_their_values_do(one: tuple, other: tuple):
    assert (Header(*one) == Header(*other)) == (one == other)
    assert (Header(*one) != Header(*other)) == (one != other)
    assert (Header(*one) < Header(*other)) == (one < other)
    assert (Header(*one) >= Header(*other)) == (one >= other)
    assert Header(*one) == one and one == Header(*one) and Header(*one) != None  # noqa: E711


@given(VALUES)
def test_a_header_is_found_as_its_values_are(values: tuple):
    header = Header(*values)
    assert hash(header) == hash(values) and {header: 1}[values] == 1 and {values: 1}[header] == 1


def test_a_header_unpacks_and_counts_as_a_tuple():
    header = Header(7, "left", origin="car1")
    stamp_ns, *names = header
    assert (stamp_ns, names, len(header)) == (7, ["left", "car1"], 3)
    assert header[0] == 7 and header[-1] == "car1" and header[:2] == (7, "left")
    assert (header.stamp_ns, header.frame_id, header.origin) == (7, "left", "car1")
    assert repr(header) == "Header(stamp_ns=7, frame_id='left', origin='car1')"


def test_a_header_can_be_changed_only_into_another():
    header = Header(7, "left", "car1")
    assert header._replace(stamp_ns=8) == Header(8, "left", "car1")
    assert header._asdict() == {"stamp_ns": 7, "frame_id": "left", "origin": "car1"}
    assert Header._fields == ("stamp_ns", "frame_id", "origin")
    with pytest.raises(AttributeError):
        header.stamp_ns = 8  # type: ignore[misc]
    with pytest.raises(TypeError):
        Header(7, "left")  # type: ignore[call-arg]
    with pytest.raises((TypeError, ValueError)):
        header._replace(stamp=8)  # type: ignore[call-arg]


def test_a_header_survives_the_way_to_another_process():
    header = Header(7, "left", "car1")
    for arrived in (pickle.loads(pickle.dumps(header)), copy.deepcopy(header)):
        assert type(arrived) is Header and arrived == header and hash(arrived) == hash(header)
