"""Token files and certificates: what opens the socket, and what is refused before anything is served."""

import os
from functools import cache
from pathlib import Path

import pytest
import trustme
from hypothesis import given, settings
from hypothesis import strategies as st

from chefbotd.rpc.access import AccessError, Guard, Keyring, load_guard
from chefbotd.rpc.parameters import ApiParameters, Role
from tests.budget import examples

ANN, BOB = "a" * 32, "b" * 32
TOKENS = f"# who drives\n\nadmin {ANN}\n  drive\t{BOB}\n"


def written(path: Path, text: str | bytes, mode: int = 0o600) -> Path:
    """A file with these contents and this mode."""
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    path.chmod(mode)
    return path


def guard_of(path: Path) -> Guard:
    """What a token file makes of the socket."""
    return load_guard(ApiParameters(token_file=path), {})


def complaint(path: Path) -> str:
    """Why a token file is refused."""
    with pytest.raises(AccessError) as caught:
        guard_of(path)
    return str(caught.value)


@cache
def keyring() -> Keyring:
    """The keyring of ``TOKENS``; making one costs as much as trying many tokens."""
    return Keyring.parse(TOKENS, "tokens")


def test_each_token_gives_its_role() -> None:
    """Comments and empty lines are passed over; the wrong token, or half of one, gives nothing."""
    keyring = Keyring.parse(TOKENS, "tokens")
    offered = [ANN, BOB, "c" * 32, ANN[:-1], ANN + "a", "", ANN.upper()]
    assert [keyring.role_of(t) for t in offered] == [Role.ADMIN, Role.DRIVE, None, None, None, None, None]


@settings(max_examples=examples(100), deadline=None)
@given(st.text(st.characters(codec="utf-8"), max_size=80))
def test_nothing_but_the_token_opens(offered: str) -> None:
    """Whatever text is offered, it is a role only if it is the token itself."""
    assert (keyring().role_of(offered) is None) == (offered not in (ANN, BOB))


def test_a_keyring_holds_no_token_in_the_clear() -> None:
    """Neither its text form nor anything it is made of has a token in it."""
    keyring = Keyring.parse(TOKENS, "tokens")
    assert ANN not in f"{keyring!r} {vars(keyring)!r}"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "contains no token; create one"),
        ("# nothing\n", "contains no token; create one"),
        (ANN, r"line 1: expected a role \(observe, guest, agent, drive, admin\)"),
        (f"\nroot {ANN}", "line 2: expected a role"),
        (f"admin {ANN} ann", "line 1: expected a role"),
        (f"{ANN} admin", "line 1: expected a role"),
        ("admin short", "line 1: a token has at least 16 characters"),
    ],
)
def test_a_token_file_that_makes_no_sense_is_refused(text: str, said: str) -> None:
    """The error has the file, the line and what was expected, and never what stands there."""
    with pytest.raises(AccessError, match=f"^/etc/tokens.*{said}") as caught:
        Keyring.parse(text, "/etc/tokens")
    assert ANN not in str(caught.value)
    assert "short" not in str(caught.value)


def test_a_private_file_is_read(tmp_path: Path) -> None:
    """Mode 600 or 400 will do."""
    for mode in (0o600, 0o400):
        keyring = guard_of(written(tmp_path / f"tokens{mode}", TOKENS, mode)).keyring
        assert keyring is not None
        assert keyring.role_of(BOB) is Role.DRIVE


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o660, 0o620, 0o602, 0o644, 0o777])
def test_a_file_that_others_have_access_to_is_refused(tmp_path: Path, mode: int) -> None:
    """Group or world, reading or writing: the error has the command that mends it."""
    path = written(tmp_path / "tokens", TOKENS, mode)
    assert complaint(path).endswith(f"run: chmod 600 {path}")


def test_a_file_that_cannot_be_read_is_refused(tmp_path: Path) -> None:
    """Missing: how to make one. A folder, or no text: why not, without the bytes."""
    assert "make it: (umask 077; echo" in complaint(tmp_path / "absent")
    folder = tmp_path / "folder"
    folder.mkdir(mode=0o700)
    assert "cannot be read: Is a directory" in complaint(folder)
    assert complaint(written(tmp_path / "noise", b"admin \xff\xfe" + b"s3cret")).endswith("is not UTF-8 text")


def test_a_systemd_credential_is_read_whatever_its_mode(tmp_path: Path) -> None:
    """Systemd shows an access list's mask as the group's mode; its directory is what keeps others out."""
    written(tmp_path / "chefbotd.tokens", TOKENS, 0o440)
    parameters = ApiParameters(token_credential="chefbotd.tokens")
    keyring = load_guard(parameters, {"CREDENTIALS_DIRECTORY": str(tmp_path)}).keyring
    assert keyring is not None
    assert keyring.role_of(ANN) is Role.ADMIN


def test_a_credential_that_systemd_did_not_pass_is_refused() -> None:
    """The error has the unit's line that is missing."""
    with pytest.raises(AccessError, match=r"LoadCredential=chefbotd\.tokens:"):
        load_guard(ApiParameters(token_credential="chefbotd.tokens"), {})


def test_nothing_configured_is_no_guard() -> None:
    """Loopback without tokens: nobody is asked, and nothing is encrypted."""
    assert load_guard(ApiParameters(), {}) == Guard(None, None)


def test_certificate_and_key_make_tls(tmp_path: Path) -> None:
    """A PEM pair gives a context; a key that others can read, no key, or one that does not fit, is refused."""
    authority = trustme.CA()
    issued, other = authority.issue_cert("127.0.0.1"), authority.issue_cert("127.0.0.1")
    certificate = written(tmp_path / "cert.pem", issued.cert_chain_pems[0].bytes())
    key = written(tmp_path / "key.pem", issued.private_key_pem.bytes())
    assert load_guard(ApiParameters(tls_certificate=certificate, tls_key=key), {}).tls is not None
    wrong = written(tmp_path / "other.pem", other.private_key_pem.bytes())
    for bad, said in ((wrong, "is not possible"), (tmp_path / "absent", "is not possible")):
        with pytest.raises(AccessError, match=said):
            load_guard(ApiParameters(tls_certificate=certificate, tls_key=bad), {})
    key.chmod(0o644)
    with pytest.raises(AccessError, match="chmod 600"):
        load_guard(ApiParameters(tls_certificate=certificate, tls_key=key), {})


def test_a_fifo_holds_nobody_up(tmp_path: Path) -> None:
    """A token file that is a FIFO nobody writes to is refused at once, and so is a certificate that is one."""
    fifo = tmp_path / "tokens"
    os.mkfifo(fifo, 0o600)
    assert str(fifo) in complaint(fifo)
    key = written(tmp_path / "key.pem", "")
    with pytest.raises(AccessError, match=str(fifo)):
        load_guard(
            ApiParameters(tls_certificate=fifo, tls_key=key, token_file=written(tmp_path / "t", TOKENS)), {}
        )
