"""A token that the daemon has issued is revoked while its client is connected."""

import asyncio

import pytest

from chefbotd.clock import run_virtual
from chefbotd.rpc.access import Guard, Keyring, digest
from chefbotd.rpc.parameters import Role
from tests.fakes.api import line_client, serving

ADMIN, PHONE = "admin" * 8, "phone" * 8


def guard() -> Guard:
    """A socket with one token of its own."""
    return Guard(Keyring({ADMIN: Role.ADMIN}))


def test_a_client_whose_token_is_revoked_drives_no_more_and_is_disconnected() -> None:
    """What it was sending is not carried out, its hold on the robot ends, and the token opens the socket no more."""

    async def main() -> None:
        async with serving(guard=guard()) as served, line_client(served) as phone:
            served.server.set_issued_tokens({digest(PHONE): Role.DRIVE})
            assert (await phone.ask("authenticate", token=PHONE))["result"]["role"] == "drive"
            assert "result" in await phone.ask("drive", linear_m_s=0.1, angular_rad_s=0.0)
            phone.request("drive", 7, linear_m_s=0.2, angular_rad_s=0.0)
            served.server.set_issued_tokens({})
            phone.request("drive", 8, linear_m_s=0.3, angular_rad_s=0.0)
            ended = await phone.read()
            assert ended["error"]["data"]["kind"] == "wrong_token"
            with pytest.raises(EOFError):
                await phone.read()
            await asyncio.sleep(1.0)
            assert [call[0] for call in served.robot.calls] == ["drive", "release"]
            async with line_client(served) as again:
                assert (await again.ask("authenticate", token=PHONE))["error"]["data"][
                    "kind"
                ] == "wrong_token"

    run_virtual(main())


@pytest.mark.parametrize("method", ["stop", "estop"])
def test_a_stop_that_was_on_its_way_when_the_token_was_revoked_is_carried_out(method: str) -> None:
    """Somebody pressed it while access ended: whoever may look may stop."""

    async def main() -> None:
        async with serving(guard=guard()) as served, line_client(served) as phone:
            served.server.set_issued_tokens({digest(PHONE): Role.OBSERVE})
            assert "result" in await phone.ask("authenticate", token=PHONE)
            phone.request(method, 7)
            served.server.set_issued_tokens({})
            await asyncio.sleep(1.0)
            assert method in str(served.robot.calls)

    run_virtual(main())
