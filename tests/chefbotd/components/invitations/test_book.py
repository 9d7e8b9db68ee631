"""Which invitation a secret opens, and how often codes may be tried."""

import pytest

from chefbotd.components.invitations.algorithms.book import (
    InvitationBook,
    NotOpen,
    TooManyAttempts,
    TooManyOpen,
    make_code,
)
from chefbotd.rpc.parameters import Role

SECRET, CODE = "s" * 22, "ABCD-2345"


def book(count: int = 1, *, lifetime_s: float = 600.0) -> InvitationBook:
    """With open invitations, made at 0 s."""
    made = InvitationBook()
    for number in range(count):
        secret, code = (SECRET, CODE) if number == 0 else (f"{SECRET}{number}", f"ZZZZ-{number:04d}")
        made.add(
            Role.GUEST,
            secret,
            code,
            0.0,
            lifetime_s=lifetime_s,
            access_s=None,
            approval=False,
            name="",
            made_by="me",
        )
    return made


@pytest.mark.parametrize("typed", [SECRET, CODE, "abcd2345", " abcd 2345 "])
def test_the_link_and_the_code_open_it_as_people_type_it(typed: str) -> None:
    """Small letters and blanks are no mistake."""
    assert book().find(typed, "phone", 1.0).number == 1


def test_a_code_ends_before_its_link() -> None:
    """The code is open for 300 s, the link for as long as was asked."""
    opened = book()
    with pytest.raises(NotOpen):
        opened.find(CODE, "phone", 300.0)
    assert opened.find(SECRET, "phone", 599.0).number == 1
    with pytest.raises(NotOpen):
        opened.find(SECRET, "phone", 600.0)


def test_one_that_was_taken_or_used_opens_nothing() -> None:
    """A phone that has come shows its ticket; its link and its code are used up."""
    opened = book()
    opened.use(1, "phone", "ticket-of-the-phone")
    for secret in (SECRET, CODE):
        with pytest.raises(NotOpen):
            opened.find(secret, "other", 1.0)
    assert opened.find("ticket-of-the-phone", "phone", 1.0).device == "phone"
    assert opened.close_invitation(1) is not None
    with pytest.raises(NotOpen):
        opened.find("ticket-of-the-phone", "phone", 1.0)


def test_codes_are_tried_slowly_and_links_are_not_held_up() -> None:
    """Five wrong codes at once from an address, then one in ten seconds; the link still opens."""
    opened = book()
    for _ in range(5):
        with pytest.raises(NotOpen):
            opened.find("WXYZ-9999", "thief", 1.0)
    with pytest.raises(TooManyAttempts):
        opened.find(CODE, "thief", 1.0)
    assert opened.find(SECRET, "thief", 1.0).number == 1
    assert opened.find(CODE, "phone", 1.0).number == 1
    assert opened.find(CODE, "thief", 11.5).number == 1


def test_many_addresses_together_try_at_most_thirty_codes_and_one_a_second() -> None:
    """Within the 300 s of a code that is at most 330 of 30 ** 8."""
    opened, tried = book(), 0
    for step in range(3000):
        try:
            opened.find("WXYZ-9999", f"thief {step}", step * 0.1)
        except NotOpen:
            tried += 1
        except TooManyAttempts:
            pass
    assert 300 <= tried <= 330


def test_no_more_than_64_are_open() -> None:
    """What has expired makes room."""
    opened = book(64)
    with pytest.raises(TooManyOpen):
        opened.add(
            Role.GUEST, "x", "y", 1.0, lifetime_s=9, access_s=None, approval=False, name="", made_by=""
        )
    assert len(opened.invitations(599.0)) == 64
    assert opened.invitations(600.0) == []


def test_a_code_has_eight_letters_that_are_not_mistaken() -> None:
    """Each is drawn from the same letters."""
    assert make_code(lambda letters: letters[0]) == "AAAA-AAAA"
    assert not set("ILOU01") & set(make_code(lambda letters: letters[-1]))
