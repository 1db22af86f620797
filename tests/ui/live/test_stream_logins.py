# SPDX-License-Identifier: GPL-3.0-or-later
"""Names and passwords of streams are taken out of addresses, and put in again."""

import pytest
from scope.scope_addon.ui.live_properties import forget_logins, take_login, with_login


@pytest.mark.parametrize(
    ("typed", "kept"),
    [
        ("rtsp://me:a@b@camera:554/x", "rtsp://camera:554/x"),
        ("http://me@camera", "http://camera"),
        ("rtsp://me:a/b@camera/x", "rtsp://camera/x"),
        ("rtsp://me:a@b/c@camera/x", "rtsp://camera/x"),
        ("rtsp://me:a?b@camera/x", "rtsp://camera/x"),
        ("http://camera/x?channel=1&token=a", "http://camera/x"),
        ("http://camera/x;Password=a", "http://camera/x"),
        (" https://:pw@[::1]:80/video?x=a@b ", "https://[::1]:80/video?x=a@b"),
    ],
)
def test_a_login_is_taken_out_and_put_in_again(typed, kept):
    assert take_login(typed) == kept
    assert with_login(kept) == typed.strip()
    forget_logins()
    assert with_login(kept) == kept


@pytest.mark.parametrize(
    "address",
    ["", "rtsp://camera:554/a@b", "http://camera?x=a@b", "udp://@", "not an address"],
)
def test_an_address_without_a_login_is_kept(address):
    taken = take_login(address)
    assert taken in (address, "udp://")
    assert with_login(taken) == address
    forget_logins()
