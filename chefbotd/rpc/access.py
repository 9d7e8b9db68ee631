"""Reads the socket's tokens and certificate, from files that only this user can read.

A token file has a line per token, ``ROLE TOKEN``; lines that are empty or begin with ``#`` are passed over. Tokens are
kept as digests: neither the memory after start-up nor a log nor an error message holds one.
"""

import hashlib
import hmac
import os
import ssl
import stat
from collections.abc import Mapping
from pathlib import Path
from typing import Self

from msgspec import Struct

from chefbotd.rpc.parameters import ApiParameters, Role
from chefbotd.storage import explain, open_regular

MIN_TOKEN_CHARACTERS = 16
MAX_FILE_BYTES = 65_536
MAKE_ONE = '(umask 077; echo "admin $(openssl rand -hex 32)" > {path})'


class AccessError(Exception):
    """The socket cannot be guarded as configured; the text says what to do, and never holds a token."""


class Keyring:
    """The tokens that open the socket, each with the role that it gives."""

    def __init__(self, tokens: Mapping[str, Role]) -> None:
        self._roles = [(digest(token), role) for token, role in tokens.items()]
        self._issued: list[tuple[bytes, Role]] = []

    @classmethod
    def parse(cls, text: str, name: str) -> Self:
        """A token file's text; raises ``AccessError``, which calls the file by ``name``."""
        tokens: dict[str, Role] = {}
        for number, line in enumerate(text.splitlines(), start=1):
            if line.strip() and not line.lstrip().startswith("#"):
                role, token = _entry(line.split(), f"{name}, line {number}")
                tokens[token] = role
        if not tokens:
            raise AccessError(f"{name}: contains no token; create one: {MAKE_ONE.format(path=name)}")
        return cls(tokens)

    def exchange(self, other: "Keyring") -> None:
        """Replace the tokens with those of another keyring; what was issued stays."""
        self._roles = other._roles

    def set_issued(self, roles: Mapping[bytes, Role]) -> None:
        """Replace the tokens that the daemon itself has issued, by their digests."""
        self._issued = list(roles.items())

    def role_of(self, token: str) -> Role | None:
        """The role that a token gives, or None; how long it takes says nothing about the tokens."""
        return self.role_of_digest(digest(token))

    def role_of_digest(self, offered: bytes) -> Role | None:
        """The role of a token by its digest."""
        match = None
        for digest, role in (*self._roles, *self._issued):
            if hmac.compare_digest(digest, offered):
                match = role
        return match


def digest(token: str) -> bytes:
    """What is kept of a token."""
    # Headers of HTTP that are not UTF-8 come with surrogates.
    return hashlib.sha256(token.encode(errors="surrogatepass")).digest()


def _entry(words: list[str], where: str) -> tuple[Role, str]:
    if len(words) != 2 or words[0] not in list(Role):
        raise AccessError(f"{where}: expected a role ({', '.join(Role)}), a space, and a token")
    role, token = words
    if len(token) < MIN_TOKEN_CHARACTERS:
        raise AccessError(f"{where}: a token has at least {MIN_TOKEN_CHARACTERS} characters")
    return Role(role), token


class Guard(Struct, frozen=True):
    """The socket's protection: its tokens (None: no client needs one), and TLS."""

    keyring: Keyring | None = None
    tls: ssl.SSLContext | None = None


def load_guard(parameters: ApiParameters, environment: Mapping[str, str]) -> Guard:
    """The configured tokens and certificate; a systemd credential is looked for by way of ``environment``.

    Raises:
        AccessError: a file cannot be read or used, or others could read it; nothing may be served then.
    """
    return Guard(_keyring(parameters, environment), _tls(parameters))


def _keyring(parameters: ApiParameters, environment: Mapping[str, str]) -> Keyring | None:
    if parameters.token_file is not None:
        return Keyring.parse(_read(parameters.token_file, private=True), str(parameters.token_file))
    if parameters.token_credential is not None:
        path = _credential(parameters.token_credential, environment)
        # systemd keeps credentials in a directory of the service's own; their mode shows an ACL's mask.
        return Keyring.parse(_read(path, private=False), str(path))
    return None


def _credential(name: str, environment: Mapping[str, str]) -> Path:
    folder = environment.get("CREDENTIALS_DIRECTORY")
    if folder is None:
        raise AccessError(
            f"api.token_credential is {name!r}, but systemd has passed no credentials: add "
            f"LoadCredential={name}:/etc/chefbotd/tokens to the unit, or set api.token_file instead"
        )
    return Path(folder, name)


def _read(path: Path, *, private: bool) -> str:
    try:
        with open_regular(path) as file:
            if private:
                _require_private(os.fstat(file.fileno()), path)
            content = file.read(MAX_FILE_BYTES + 1)
        if len(content) > MAX_FILE_BYTES:
            raise AccessError(
                f"{path}: is larger than {MAX_FILE_BYTES // 1024} KiB, expected a file of tokens"
            )
        return content.decode()
    except OSError as error:
        hint = f"; make it: {MAKE_ONE.format(path=path)}" if isinstance(error, FileNotFoundError) else ""
        raise AccessError(f"{path}: cannot be read: {explain(error)}{hint}") from error
    except UnicodeDecodeError:
        raise AccessError(f"{path}: is not UTF-8 text") from None  # the error would hold the file's bytes


def _require_private(status: os.stat_result, path: Path) -> None:
    if status.st_mode & (stat.S_IRWXG | stat.S_IRWXO):
        raise AccessError(f"{path}: users other than its owner can read it; run: chmod 600 {path}")


def renew_certificate(context: ssl.SSLContext, parameters: ApiParameters) -> None:
    """Show clients that connect from now on the certificate that is in the files now.

    Raises:
        AccessError: the files cannot be used, as while one of them has been replaced and the other not yet.
    """
    renewed = _tls(parameters)
    if renewed is None:
        return

    def show(connection: ssl.SSLObject, _name: str | None, _context: ssl.SSLContext) -> None:
        connection.context = renewed  # OpenSSL asks in each handshake, whether a name was sent or not

    context.sni_callback = show


def _tls(parameters: ApiParameters) -> ssl.SSLContext | None:
    """What proves to clients that they talk to this robot."""
    certificate, key = parameters.tls_certificate, parameters.tls_key
    if certificate is None or key is None:
        return None
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    try:
        for file in (certificate, key):
            open_regular(file).close()
        _require_private(key.stat(), key)
        context.load_cert_chain(certificate, key)
    except OSError as error:  # ssl.SSLError is one
        raise AccessError(f"TLS with {certificate} and {key} is not possible: {error}") from error
    return context
