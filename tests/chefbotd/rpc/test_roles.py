"""Roles: each has what the ones before it have."""

import pytest

from chefbotd.rpc.parameters import Role


@pytest.mark.parametrize(
    ("role", "needed", "allowed"),
    [
        (Role.OBSERVE, Role.OBSERVE, True),
        (Role.OBSERVE, Role.DRIVE, False),
        (Role.OBSERVE, Role.ADMIN, False),
        (Role.DRIVE, Role.OBSERVE, True),
        (Role.DRIVE, Role.DRIVE, True),
        (Role.DRIVE, Role.ADMIN, False),
        (Role.ADMIN, Role.OBSERVE, True),
        (Role.ADMIN, Role.DRIVE, True),
        (Role.ADMIN, Role.ADMIN, True),
    ],
)
def test_a_role_allows_what_the_lesser_ones_do(role: Role, needed: Role, allowed: bool) -> None:
    """Every pair: observe < drive < admin."""
    assert role.allows(needed) is allowed
