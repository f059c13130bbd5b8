"""Errors of a link: which of them no second call mends, and addresses that are none."""

from __future__ import annotations

import ssl

import pytest

pytest.importorskip("rosbags", reason="needs rosbags: pip install 'genie-sim[ros]'")

from genie_sim.errors import UserError
from genie_sim.ros import link
from genie_sim.ros.connection import Refused


def tls_error(text: str) -> ssl.SSLError:
    error = ssl.SSLError(1, text)
    error.reason = text
    return error


@pytest.mark.parametrize(
    ("error", "is_refusal"),
    [
        (Refused("you are not expected"), True),
        (tls_error("certificate verify failed"), True),
        (tls_error("tlsv1 alert unknown ca"), True),
        (tls_error("unexpected eof while reading"), False),
        (ConnectionResetError("certificate"), False),
        (OSError("no route to host"), False),
    ],
)
def test_who_is_refused_need_not_call_at_once(error: Exception, is_refusal: bool):
    assert link.is_refusal(error) is is_refusal


def test_addresses():
    assert link._address("192.168.0.7:0") == ("192.168.0.7", 0)
    assert link._address("[::1]:65535") == ("[::1]", 65535)
    assert link._named_address("edge1@host:7411") == ("edge1", ("host", 7411))
    for wrong in ("host", "host:", "host:65536", "host:123456", "host:-1", "host:٣"):
        with pytest.raises(UserError, match="is no address; write host:port"):
            link._address(wrong)
    for wrong in ("host:7411", "@host:7411", "a b@host:7411"):
        with pytest.raises(UserError, match="does not say whom to connect to; write name@host"):
            link._named_address(wrong)
