"""Writes a support bundle: everything that a helper needs to see, without secrets.

Paths of token files stay in the configuration, their contents never enter: each of their words of eight characters or
more, and the program's own token, is replaced in every file, and so is what looks like a credential.
"""

import io
import json
import platform
import re
import sys
import tarfile
import time
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from importlib import metadata
from pathlib import Path
from typing import Any

import structlog

from chefbotd import __version__
from chefbotd.cli.common.context import CommandContext
from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.client import CallError, Client
from chefbotd.components.doctor.algorithms.finding import Finding
from chefbotd.components.doctor.cli import host, view
from chefbotd.rpc.parameters import is_loopback
from chefbotd.settings import Settings
from chefbotd.settings.sections import secrets_of

REMOVED = "[removed]"
SECRET_KEY = re.compile(r"(?i)(token|password|passwd|secret|api_key|private_key|credential)s?$")
SECRET_TEXT = (
    re.compile(
        r"(?i)(\"?(?:token|password|passwd|secret|api_key)\"?\s*[=:]\s*\"?)(?!null(?:[\s,}\]]|$))([^\s\"',}]{4,})"
    ),
    re.compile(r"(?i)(bearer\s+|token\.)([A-Za-z0-9._~+/=-]{8,})"),
    re.compile(r"(\w+://[^\s/:@]+:)([^\s/@]+)(?=@)"),
    re.compile(r"()(-----BEGIN [A-Z ]*PRIVATE KEY-----.*?-----END [A-Z ]*PRIVATE KEY-----)", re.DOTALL),
)
SHORTEST_SECRET = 8
ROLES = frozenset({"observe", "guest", "agent", "drive", "admin"})
LOG_LINES = "3000"
FAULT_LINE = re.compile(r"lines around a fault|disarmed|estop|fault", re.IGNORECASE)
MOST_SECRET_FILE_BYTES = 65_536


class Redactor:
    """Takes known secrets, and what looks like one, out of text."""

    def __init__(self, secrets: Iterable[str]) -> None:
        self._secrets = sorted(
            {secret for secret in secrets if len(secret) >= SHORTEST_SECRET}, key=len, reverse=True
        )

    def clean(self, text: str) -> str:
        """The text without secrets."""
        for secret in self._secrets:
            text = text.replace(secret, REMOVED)
        for pattern in SECRET_TEXT:
            text = pattern.sub(rf"\g<1>{REMOVED}", text)
        return text


def secrets_in(*files: Path | None) -> list[str]:
    """Every word of token files that we may read, but for comments and the roles."""
    words: list[str] = []
    for file in files:
        try:
            text = "" if file is None else file.read_bytes()[:MOST_SECRET_FILE_BYTES].decode(errors="replace")
        except OSError:
            continue
        words += [word for word in text.split() if word not in ROLES]
    return words


def texts_in(values: Any) -> list[str]:
    """Every text in the settings of plug-ins, of which only they know what is a secret; they log it, perhaps."""
    if isinstance(values, str):
        return [values]
    inner = (
        values.values() if isinstance(values, Mapping) else values if isinstance(values, list | tuple) else ()
    )
    return [text for value in inner for text in texts_in(value)]


def without_secrets(values: Any) -> Any:
    """Configuration values with those removed whose key names a secret itself; a path to one stays."""
    if isinstance(values, Mapping):
        return {
            key: REMOVED if SECRET_KEY.search(str(key)) and value else without_secrets(value)
            for key, value in values.items()
        }
    if isinstance(values, list | tuple):
        return [without_secrets(value) for value in values]
    return values


def versions() -> str:
    """Versions of the program, of Python, of the computer, and of the packages that it needs."""
    lines = [
        f"chefbotd {__version__}",
        f"python {sys.version.split()[0]} ({platform.python_implementation()})",
        f"kernel {platform.platform()}",
        f"machine {platform.machine()}",
    ]
    for required in sorted(metadata.requires("chefbotd") or []):
        name = re.split(r"[^\w.-]", required, maxsplit=1)[0]
        try:
            lines.append(f"{name} {metadata.version(name)}")
        except metadata.PackageNotFoundError:
            lines.append(f"{name} is not installed")
    return "\n".join(dict.fromkeys(lines)) + "\n"


def fault_lines(log: str) -> str:
    """The log's lines about faults and stops."""
    return "".join(line for line in log.splitlines(keepends=True) if FAULT_LINE.search(line))


def contents(
    findings: Mapping[str, object], configuration: object, stats: object, state: object, log: str | None
) -> dict[str, str]:
    """The text files of the bundle by their names."""
    log_text = (
        log if log is not None else "The log could not be read: 'journalctl -u chefbotd' needs its group.\n"
    )
    return {
        "findings.json": json.dumps(findings, indent=2),
        "versions.txt": versions(),
        "configuration.json": json.dumps(without_secrets(configuration), indent=2),
        "stats.json": json.dumps(stats, indent=2),
        "state.json": json.dumps(state, indent=2),
        "log.txt": log_text,
        "faults.txt": fault_lines(log or ""),
    }


def write_bundle(
    path: Path, files: Mapping[str, str], redactor: Redactor, recordings: Iterable[Path] = ()
) -> None:
    """Write the files to a new archive that only its owner can read.

    ``recordings`` go in as they are: the recorder keeps the parameters of no request that holds a secret.

    Raises:
        ProgramError: it is there already, or cannot be written.
    """
    folder, now_s = path.name.removesuffix(".tar.gz"), time.time()
    try:
        with path.open("xb") as raw:
            path.chmod(0o600)
            with tarfile.open(fileobj=raw, mode="w:gz") as archive:
                for name, text in files.items():
                    data = redactor.clean(text).encode()
                    entry = tarfile.TarInfo(f"{folder}/{name}")
                    entry.size, entry.mtime, entry.mode = len(data), int(now_s), 0o600
                    archive.addfile(entry, io.BytesIO(data))
                for recording in recordings:
                    archive.add(recording, f"{folder}/{recording.name}")
    except FileExistsError as error:
        raise ProgramError(Exit.FAILED, f"{path}: already exists, and is not overwritten") from error
    except OSError as error:
        raise ProgramError(Exit.FAILED, f"{path}: cannot be written: {error.strerror}") from error


LINES_KEPT = 3000


class LogKept:
    """A stream that keeps the newest lines."""

    def __init__(self) -> None:
        self._lines: deque[str] = deque(maxlen=LINES_KEPT)

    def write(self, text: str) -> None:
        """Keep a line."""
        self._lines.append(text)

    def flush(self) -> None:
        """Nothing to do."""

    def text(self) -> str:
        """All that is kept."""
        return "".join(self._lines)


def keep_log() -> LogKept:
    """Have everything that is logged in this process kept instead of printed."""
    kept = LogKept()
    structlog.configure(
        processors=[
            structlog.processors.add_log_level,
            structlog.processors.TimeStamper(fmt="iso", utc=True),
            structlog.processors.format_exc_info,
            structlog.processors.JSONRenderer(default=str),
        ],
        logger_factory=structlog.WriteLoggerFactory(kept),  # type: ignore[arg-type]
        cache_logger_on_first_use=False,
    )
    return kept


MOST_RECORDING_BYTES = 50_000_000


async def gather_bundle(
    settings: Settings, findings: Sequence[Finding], context: CommandContext, bundle: Path, own_log: str
) -> None:
    """Write the bundle; a daemon that does not answer leaves its part out.

    Raises:
        ProgramError: it cannot be written.
    """
    figures, recordings = await _of_daemon(context)
    log = await host.command_output("journalctl", "--unit=chefbotd", f"--lines={LOG_LINES}", "--no-pager")
    configuration = settings.model_dump(mode="json", by_alias=True)
    files = contents(view.as_data(findings), configuration, figures.get("stats"), figures.get("state"), log)
    files["doctor.txt"] = own_log
    if problem := figures.get("not_asked"):
        files["daemon.txt"] = f"{problem}\n"
    secrets = [context.credentials.token or "", *secrets_in(settings.api.token_file, settings.api.tls_key)]
    secrets += [*texts_in(settings.plugins.settings), *secrets_of(settings)]
    write_bundle(bundle, files, Redactor(secrets), recordings)


async def _of_daemon(context: CommandContext) -> tuple[dict[str, Any], list[Path]]:
    """Its figures, and the file of its recorder's last minutes, where that is on this computer."""

    async def ask(robot: Client) -> tuple[dict[str, Any], list[Path]]:
        figures = {"stats": await robot.call("get_stats"), "state": await robot.call("get_state")}
        is_here = is_loopback(context.address.host)
        return figures, await _ring(robot) if is_here else []

    try:
        return await context.with_client(ask)
    except ProgramError as failure:
        return {"not_asked": str(failure)}, []


async def _ring(robot: Client) -> list[Path]:
    """The last minutes, written to a file by the daemon; nothing where it has no recorder, or may not write."""
    if "method.save_ring" not in robot.hello.capabilities:
        return []
    try:
        saved = Path((await robot.save_ring("doctor")).file)
    except CallError:
        return []
    return [saved] if _is_small_file(saved) else []


def _is_small_file(path: Path) -> bool:
    try:
        return path.stat().st_size <= MOST_RECORDING_BYTES
    except OSError:
        return False
