"""A phone is let in: over a real socket with tokens, on the virtual clock."""

import asyncio
import json
import stat
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from chefbotd.clock import LoopClock, run_virtual
from chefbotd.components.invitations.access_file import AccessFile
from chefbotd.components.invitations.qr import qr_rows, terminal_qr
from chefbotd.components.invitations.service import Invitations
from chefbotd.components.invitations.token_file import token
from chefbotd.rpc.access import Keyring
from chefbotd.rpc.method import methods_of
from chefbotd.rpc.parameters import Role
from tests.waiting import until

ADMIN = "admin-token-0123456789"


class Server:
    """What opens the socket, without one; remembers who is let in."""

    asks_for_tokens = True

    def __init__(self) -> None:
        self.keyring = Keyring({ADMIN: Role.ADMIN})

    def set_issued_tokens(self, roles: Any) -> None:
        """As the daemon's."""
        self.keyring.set_issued(roles)


class Caller:
    """A client from an address."""

    class session:  # noqa: N801 - an attribute of a caller
        """Who it is."""

        host = "192.168.1.9"


class Wall:
    """The time since 1970, which a test sets."""

    now_s = 1_000_000.0

    def __call__(self) -> float:
        """Now."""
        return self.now_s


class Bench:
    """The component with its methods by name."""

    def __init__(self, folder: Path, wall: Wall, *, encrypted: bool = False) -> None:
        self.server, self.file = Server(), AccessFile(folder / "state" / "access.json")

        async def base() -> tuple[str, bool]:
            return "http://192.168.1.20:7380/", False

        self.service = Invitations(
            LoopClock(), wall, self.file, lambda: self.server, base, encrypted=encrypted
        )
        self._methods = {row.name: row for row in methods_of(self.service)}

    async def ask(self, name: str, **params: Any) -> Any:
        """Call a method of the socket."""
        row = self._methods[name]
        checked = row.params.model_validate(params)
        if asyncio.iscoroutinefunction(row.handle):
            return await row.handle(Caller, checked, None)
        return row.handle(Caller, checked)


@asynccontextmanager
async def running(folder: Path, wall: Wall | None = None, **options: Any) -> AsyncIterator[Bench]:
    """The component, which has read its file."""
    bench = Bench(folder, wall or Wall(), **options)
    task = asyncio.create_task(bench.service.run())
    await until(lambda: bench.service._access_list is not None)
    try:
        yield bench
    finally:
        task.cancel()


def secret_of(made: Any) -> str:
    """What stands in the link behind ``#join=``."""
    return str(made.link).partition("#join=")[2]


def test_of_fifty_that_redeem_it_at_once_one_comes_in(tmp_path: Path) -> None:
    """The others are refused; the secret has 22 letters of base64, 128 bits."""

    async def main() -> None:
        async with running(tmp_path) as bench:
            made = await bench.ask("make_invitation", role="guest")
            assert len(secret_of(made)) == 22
            came = await asyncio.gather(
                *(bench.ask("redeem_invitation", secret=secret_of(made)) for _ in range(50)),
                return_exceptions=True,
            )
            tokens = [each.token for each in came if not isinstance(each, BaseException)]
            assert len(tokens) == 1
            assert {getattr(each, "kind", "") for each in came} == {"", "not_invited"}
            assert bench.server.keyring.role_of(tokens[0]) is Role.GUEST
            assert tokens[0].encode() not in (tmp_path / "state" / "access.json").read_bytes()

    run_virtual(main())


def test_access_survives_a_restart_and_ends_when_it_is_revoked_or_expires(tmp_path: Path) -> None:
    """After a restart the token opens the socket; revoked or 60 s old it does not, also after another restart."""
    wall = Wall()

    async def admitted(bench: Bench, **params: Any) -> str:
        made = await bench.ask("make_invitation", role="drive", **params)
        return str((await bench.ask("redeem_invitation", secret=made.code)).token)

    async def main() -> None:
        async with running(tmp_path, wall) as bench:
            first, second = await admitted(bench), await admitted(bench, access_s=60.0)
        async with running(tmp_path, wall) as bench:
            await asyncio.sleep(0.1)
            role_of = bench.server.keyring.role_of
            assert (role_of(first), role_of(second)) == (Role.DRIVE, Role.DRIVE)
            wall.now_s += 61.0
            await asyncio.sleep(5.1)
            assert (role_of(first), role_of(second)) == (Role.DRIVE, None)
            await bench.ask("revoke_access", device=1)
            assert role_of(first) is None
            assert role_of(ADMIN) is Role.ADMIN
        async with running(tmp_path, wall) as bench:
            assert bench.server.keyring.role_of(first) is None

    run_virtual(main())


def test_a_clock_that_is_set_back_neither_lengthens_access_nor_brings_it_back(tmp_path: Path) -> None:
    """Two phones with 60 s: a clock that goes back an hour, a second start in 1970, and one at the right time."""
    wall = Wall()
    file = tmp_path / "state" / "access.json"

    async def admitted(bench: Bench) -> str:
        made = await bench.ask("make_invitation", role="drive", access_s=60.0)
        return str((await bench.ask("redeem_invitation", secret=made.code)).token)

    async def main() -> None:
        async with running(tmp_path, wall) as bench:
            first = await admitted(bench)
            wall.now_s -= 3600.0
            await asyncio.sleep(50.0)
            second = await admitted(bench)
            assert bench.server.keyring.role_of(first) is Role.DRIVE
            await asyncio.sleep(15.5)
            assert bench.server.keyring.role_of(first) is None
            assert [device["number"] for device in json.loads(file.read_text())["devices"]] == [2]
        wall.now_s = 0.0
        async with running(tmp_path, wall) as bench:
            await asyncio.sleep(0.1)
            assert bench.server.keyring.role_of(first) is None
            assert bench.server.keyring.role_of(second) is Role.DRIVE
            await asyncio.sleep(65.5)
            assert bench.server.keyring.role_of(second) is None
        wall.now_s = 1_000_000.0
        async with running(tmp_path, wall) as bench:
            await asyncio.sleep(0.1)
            assert bench.server.keyring.role_of(second) is None
            assert (await bench.ask("list_invitations")).devices == ()

    run_virtual(main())


def test_access_that_ended_on_a_full_disk_has_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The token opens nothing; the file is written once there is room again."""
    wall = Wall()

    async def main() -> None:
        async with running(tmp_path, wall) as bench:
            made = await bench.ask("make_invitation", role="drive", access_s=60.0)
            token = str((await bench.ask("redeem_invitation", secret=made.code)).token)

            def full(_: AccessFile, access_list: Any) -> None:
                raise OSError(28, "No space left on device")

            with monkeypatch.context() as patched:
                patched.setattr(AccessFile, "write", full)
                await asyncio.sleep(70.0)
                assert bench.server.keyring.role_of(token) is None
                assert len(bench.file.read().devices) == 1
            await asyncio.sleep(6.0)
            assert bench.file.read().devices == ()

    run_virtual(main())


def test_a_phone_waits_until_somebody_approves_it(tmp_path: Path) -> None:
    """It gets a ticket, then its token; the link is used up by then, and a revoked one gives nothing."""

    async def main() -> None:
        async with running(tmp_path) as bench:
            made = await bench.ask("make_invitation", approval=True)
            waits = await bench.ask("redeem_invitation", secret=secret_of(made), device="Ann's phone")
            assert (waits.state, waits.token) == ("waiting", "")
            assert (await bench.ask("redeem_invitation", secret=waits.ticket)).state == "waiting"
            assert (await bench.ask("list_invitations")).invitations[0].device == "Ann's phone"
            with pytest.raises(Exception, match="not open"):
                await bench.ask("redeem_invitation", secret=secret_of(made))
            await bench.ask("approve_invitation", invitation=made.invitation)
            assert (await bench.ask("redeem_invitation", secret=waits.ticket)).state == "admitted"
            other = await bench.ask("make_invitation")
            await bench.ask("revoke_access", invitation=other.invitation)
            with pytest.raises(Exception, match="not open"):
                await bench.ask("redeem_invitation", secret=secret_of(other))

    run_virtual(main())


def test_a_disk_that_fails_lets_nobody_in_and_leaves_the_invitation_open(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The phone is told, and comes in once there is room again."""

    async def main() -> None:
        async with running(tmp_path) as bench:
            made = await bench.ask("make_invitation")

            def fail(_: object) -> None:
                raise OSError(28, "No space left on device")

            with monkeypatch.context() as patched:
                patched.setattr(bench.file, "write", fail)
                with pytest.raises(Exception, match="the disk is full"):
                    await bench.ask("redeem_invitation", secret=secret_of(made))
            assert (await bench.ask("redeem_invitation", secret=secret_of(made))).state == "admitted"

    run_virtual(main())


def test_a_damaged_file_is_said_and_not_written_over(tmp_path: Path) -> None:
    """Nobody is let in, the file stays as it is."""
    (tmp_path / "state").mkdir()
    path = tmp_path / "state" / "access.json"
    path.write_text('{"version": 1, "devices": [{"number"')

    async def main() -> None:
        bench = Bench(tmp_path, Wall())
        task = asyncio.create_task(bench.service.run())
        await until(lambda: "being read" not in bench.service._unreadable)
        made = await bench.ask("make_invitation")
        with pytest.raises(Exception, match="no list of those who were let in"):
            await bench.ask("redeem_invitation", secret=secret_of(made))
        task.cancel()

    run_virtual(main())
    assert path.read_text() == '{"version": 1, "devices": [{"number"'


def test_an_administrator_is_invited_only_over_tls(tmp_path: Path) -> None:
    """By plain http others in the network could read the token."""

    async def main() -> None:
        async with running(tmp_path) as bench:
            with pytest.raises(Exception, match="only over TLS"):
                await bench.ask("make_invitation", role="admin")
        async with running(tmp_path, encrypted=True) as bench:
            assert (await bench.ask("make_invitation", role="admin")).role is Role.ADMIN

    run_virtual(main())


def test_the_qr_code_has_three_finders_and_a_quiet_zone_in_the_terminal() -> None:
    """ISO/IEC 18004: each finder is 7 modules wide with a dark frame; 4 light modules lie around the code."""
    rows = qr_rows("http://192.168.100.200:7380/#join=" + "s" * 22)
    assert len(rows) == len(rows[0]) == 33  # version 4 holds 62 bytes at level M
    for corner in (rows[0][:7], rows[0][-7:], rows[-1][:7]):
        assert corner == "1111111"
    lines = terminal_qr(rows).split("\n")
    assert len(lines) == 21  # (33 + 8 + 1) / 2
    assert set(lines[0].removeprefix("\x1b[30;107m").removesuffix("\x1b[0m")) == {" "}


def test_a_token_is_made_by_a_command_in_a_file_for_its_owner_alone(tmp_path: Path) -> None:
    """Added to what is there; a file that is none stays as it is."""
    path = tmp_path / "tokens"
    for role in ("admin", "drive"):
        assert CliRunner().invoke(token, ["new", role, "--file", str(path)]).exit_code == 0
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    lines = path.read_text().splitlines()
    assert [line.split()[0] for line in lines] == ["admin", "drive"]
    assert Keyring.parse(path.read_text(), "tokens").role_of(lines[1].split()[1]) is Role.DRIVE
    path.write_text("no token file at all\n")
    assert CliRunner().invoke(token, ["new", "drive", "--file", str(path)]).exit_code != 0
    assert path.read_text() == "no token file at all\n"
