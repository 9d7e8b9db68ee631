"""``chefbot-speech``: says aloud what agents say, and serves the page with the button to talk."""

import asyncio
import contextlib
import shutil
import signal
import ssl
from collections.abc import Awaitable, Callable
from functools import partial
from pathlib import Path
from typing import Any

import click

from chefbot_speech.agent import SpeechAgent
from chefbot_speech.ear import Ear
from chefbot_speech.server import NotAdmitted, PageServer, Send, Talker
from chefbot_speech.speaker import Espeak, Flite, Speaker, Voice, player
from chefbot_speech.talker import PageTalker, Talkers
from chefbotd.client import CallError, ChefbotError
from chefbotd.client.access import CA_HELP, CLEAR_TOKEN_HELP, daemon_access
from chefbotd.rpc.parameters import is_loopback

PORT = 7381
MAY_TALK = ("agent", "drive", "admin")


def admit(
    connect: Callable[..., Any], make: Callable[[Send], PageTalker], *, needs_tokens: bool = False
) -> Callable[[str | None, Send], Awaitable[Talker]]:
    """Who may send the robot to goals by the daemon's tokens may do so by voice.

    A daemon without tokens takes any. With ``needs_tokens``, where others than this computer reach the page, nobody may
    talk to that one.
    """

    async def admitted(token: str | None, send: Send) -> Talker:
        try:
            async with connect(token=token) as robot:
                if needs_tokens and robot.hello.auth != "token":
                    raise NotAdmitted("the daemon asks for no tokens, so only its own computer may talk")
                role = (await robot.call("authenticate", token=token or ""))["role"]
        except CallError as refused:
            raise NotAdmitted(refused.message if token else "show a token") from refused
        except ChefbotError as problem:
            raise NotAdmitted(f"The robot's daemon does not answer: {problem}") from problem
        if role not in MAY_TALK:
            raise NotAdmitted(f"the role {role} may not send the robot anywhere")
        talker = make(send)
        await talker.begin()
        return talker

    return admitted


def voice_of(program: str, language: str) -> Voice:
    """espeak-ng, unless flite is asked for, or is all that is there."""
    is_flite = program == "flite" or (program == "auto" and shutil.which("espeak-ng") is None)
    return Flite() if is_flite and shutil.which("flite") is not None else Espeak(language)


def tls_of(certificate: Path | None, key: Path | None) -> ssl.SSLContext | None:
    """The page's certificate, if it has one."""
    if certificate is None:
        return None
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(certificate, key)
    return context


@click.command(help=(__doc__ or "").partition(": ")[2])
@click.option("--connect", "where", default="127.0.0.1:7333", metavar="HOST:PORT", help="The robot's daemon.")
@click.option("--token-file", type=click.Path(path_type=Path), help="A file with a token of the role agent.")
@click.option("--ca", "--trust", "ca", type=click.Path(path_type=Path), help=CA_HELP)
@click.option("--clear-token", is_flag=True, help=CLEAR_TOKEN_HELP)
@click.option("--host", default="127.0.0.1", show_default=True, help="Where the page listens.")
@click.option("--port", default=PORT, show_default=True, help="Where the page listens.")
@click.option("--host-name", "names", multiple=True, help="A name of this computer, beside its addresses.")
@click.option("--certificate", type=click.Path(path_type=Path), help="The page's certificate (PEM).")
@click.option("--key", type=click.Path(path_type=Path), help="Its key (PEM).")
@click.option("--voice", type=click.Choice(["auto", "espeak-ng", "flite"]), default="auto", show_default=True)
@click.option(
    "--language", default="en", show_default=True, help="A voice of espeak-ng, such as de or en-us+f3."
)
@click.option(
    "--countdown-s", type=click.FloatRange(2.0, 60.0), help="Begin a goal without a yes after this time."
)
@click.option("--recognizer", metavar="MODULE:CLASS", help="Another recognizer than Whisper or pocketsphinx.")
def main(
    where: str,
    token_file: Path | None,
    ca: Path | None,
    host: str,
    port: int,
    *,
    clear_token: bool,
    **options: Any,
) -> None:
    """Run until Ctrl-C."""
    daemon_host, _, daemon_port = where.rpartition(":")
    certificate = options["certificate"]
    try:
        access = daemon_access(daemon_host, int(daemon_port), token_file, ca, clear_token=clear_token)
    except ValueError as error:
        raise click.UsageError(str(error)) from error
    token = access.token
    if not is_loopback(host) and (certificate is None or token is None):
        why = "beyond this computer the page needs --certificate (browsers give no microphone without https)"
        raise click.UsageError(f"{why} and the daemon tokens (--token-file)")
    connect = partial(access.connect_as, name="speech")
    with_token = partial(access.connect, "speech")
    with contextlib.suppress(asyncio.CancelledError):  # ended by a signal
        asyncio.run(_run(connect, with_token, host, port, options))


async def _run(
    connect: Callable[..., Any], with_token: Callable[..., Any], host: str, port: int, options: dict[str, Any]
) -> None:
    if (running := asyncio.current_task()) is not None:
        asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, running.cancel)
    ear = Ear(options["recognizer"])
    ear.begin()
    speaker = Speaker(voice_of(options["voice"], options["language"]), player())
    talkers = Talkers()
    agent = SpeechAgent(with_token, speaker, ear, talkers.end_countdowns)

    def make(send: Send) -> PageTalker:
        return PageTalker(send, agent, ear.recognize, talkers, options["countdown_s"])

    admitted = admit(connect, make, needs_tokens=not is_loopback(host))
    page = PageServer(admitted, tls_of(options["certificate"], options["key"]), options["names"])
    try:
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(speaker.run())
            tasks.create_task(agent.run())
            tasks.create_task(
                page.run(host, port, lambda url: click.echo(f"Talk at {url} (Ctrl-C ends it)."))
            )
    finally:
        ear.close()


if __name__ == "__main__":
    main()
