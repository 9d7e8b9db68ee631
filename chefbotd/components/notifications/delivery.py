"""Hands a message to a server by HTTP, in a thread of its own for each attempt, so that no server holds up the loop."""

import asyncio
import base64
import http.client
import json
import threading
from collections.abc import Mapping
from typing import Final
from urllib.parse import urlsplit

from pydantic import SecretStr

from chefbotd.components.notifications.episodes import Notice
from chefbotd.components.notifications.parameters import NoticeKind, NotificationsParameters
from chefbotd.core.record import Record

SOCKET_TIMEOUT_S: Final = 5.0
"""How long a server may be silent."""

ATTEMPT_S: Final = 15.0
"""How long an attempt may take in all; one that sends a byte now and then is silent never."""

AGE_TOLD_S: Final = 30.0
"""A message that is older says how old it is."""

URGENT: Final = frozenset({NoticeKind.FAULT, NoticeKind.STUCK, NoticeKind.DAEMON_GONE})
AGAIN: Final = frozenset({408, 425, 429})
"""The client's errors that pass."""


class NotTaken(Exception):
    """The server has answered that it does not take the message; ``again``: it may do so later."""

    def __init__(self, status: int) -> None:
        super().__init__(f"HTTP status {status}")
        self.again = status in AGAIN or status >= 500


class Undeliverable(OSError):
    """The attempt has failed in a way of its own, such as a host's name that is none."""


class Post(Record, frozen=True):
    """A request: its address holds a secret, and stands in no log."""

    url: str
    headers: Mapping[str, str]
    body: bytes


class MessageServer(Record, frozen=True):
    """A server that is told: ``name`` is ``ntfy`` or ``webhook``."""

    name: str
    url: SecretStr
    token: SecretStr | None

    @property
    def host(self) -> str:
        """Whose server it is: what may be shown of the address."""
        return urlsplit(self.url.get_secret_value()).hostname or ""

    def make_post(self, notice: Notice, robot: str, age_s: float, number: str) -> Post:
        """The request for a message that is this old; ``number`` is the same each time that it is tried."""
        text = f"{notice.text} (This was {_words_of(age_s)} ago.)" if age_s >= AGE_TOLD_S else notice.text
        headers = {"User-Agent": "chefbotd"}
        if self.token is not None:
            headers["Authorization"] = f"Bearer {self.token.get_secret_value()}"
        title = f"{robot}: {notice.title}"
        if self.name == "ntfy":
            headers["Title"] = _header_text(title)
            headers["Priority"] = "high" if notice.kind in URGENT else "default"
            return Post(self.url.get_secret_value(), headers, text.encode(errors="replace"))
        headers["Content-Type"] = "application/json"
        members = {"id": number, "robot": robot, "kind": notice.kind, "title": title, "text": text}
        body = json.dumps({**members, "age_s": round(age_s, 1)})
        return Post(self.url.get_secret_value(), headers, body.encode())


def targets_of(section: NotificationsParameters) -> list[MessageServer]:
    """Every server that the section names."""
    pairs = (
        ("ntfy", section.ntfy_url, section.ntfy_token),
        ("webhook", section.webhook_url, section.webhook_token),
    )
    return [MessageServer(name, url, token) for name, url, token in pairs if url is not None]


class Attempt:
    """One attempt to hand a request over; ``send`` blocks, ``abandon`` ends it from another thread."""

    def __init__(self, post: Post) -> None:
        self._post = post
        self._connection: http.client.HTTPConnection | None = None

    def send(self) -> None:
        """Send it and read the answer's status.

        Raises:
            OSError, http.client.HTTPException: there is no answer; NotTaken: it is none of 200 to 299.
        """
        parts = urlsplit(self._post.url)
        is_encrypted = parts.scheme == "https"
        kind = http.client.HTTPSConnection if is_encrypted else http.client.HTTPConnection
        self._connection = connection = kind(parts.hostname or "", parts.port, timeout=SOCKET_TIMEOUT_S)
        try:
            path = (parts.path or "/") + (f"?{parts.query}" if parts.query else "")
            connection.request("POST", path, self._post.body, dict(self._post.headers))
            status = connection.getresponse().status
        finally:
            connection.close()
        if not 200 <= status < 300:
            raise NotTaken(status)

    def abandon(self) -> None:
        """Cut the connection, if there is one, so that ``send`` ends."""
        sock = None if self._connection is None else self._connection.sock
        if sock is not None:
            try:
                sock.shutdown(2)  # SHUT_RDWR: a read in the other thread returns
            except OSError:  # it is closed already
                return


async def deliver(post: Post, within_s: float = ATTEMPT_S) -> None:
    """Hand a request over without ever holding up the loop.

    Raises:
        OSError, http.client.HTTPException: there is no answer; NotTaken: it is not taken.
    """
    loop = asyncio.get_running_loop()
    done: asyncio.Future[None] = loop.create_future()
    attempt = Attempt(post)

    def finish(error: Exception | None) -> None:
        if done.done():
            return
        if error is None:
            done.set_result(None)
        else:
            done.set_exception(error)

    def send() -> None:
        error: Exception | None = None
        try:
            attempt.send()
        except Exception as raised:  # noqa: BLE001 - handed to the loop
            expected = isinstance(raised, OSError | http.client.HTTPException | NotTaken)
            error = raised if expected else Undeliverable(type(raised).__name__)
        if not loop.is_closed():
            try:
                loop.call_soon_threadsafe(finish, error)
            except RuntimeError:  # it was closed just now: nobody waits any more
                return

    try:
        threading.Thread(target=send, name="notification", daemon=True).start()
    except RuntimeError as error:  # the computer has no room for a thread: the robot drives on
        raise Undeliverable(str(error)) from error
    try:
        async with asyncio.timeout(within_s):
            await done
    finally:
        attempt.abandon()


def _header_text(text: str) -> str:
    """Text as a header may hold it: RFC 2047, which ntfy reads, where it is not plain."""
    if text.isascii() and text.isprintable():
        return text
    return f"=?UTF-8?B?{base64.b64encode(text.encode(errors='replace')).decode()}?="


def _words_of(age_s: float) -> str:
    if age_s < 90:
        return f"{age_s:.0f} s"
    return f"{age_s / 60:.0f} min" if age_s < 5400 else f"{age_s / 3600:.1f} h"
