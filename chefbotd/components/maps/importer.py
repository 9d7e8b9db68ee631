"""Runs the program that imports a map, reports its progress, and ends it when its client leaves."""

import asyncio
import json
import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import msgspec

from chefbotd.child import send_signal
from chefbotd.components.maps.storage.disk import MapStoreError
from chefbotd.components.maps.storage.importing import Order
from chefbotd.core.commands import RefusalKind
from chefbotd.core.sentence import Sentence

Report = Callable[[float, float, str], None]
MOST_LINE_BYTES = 65_536
REPEAT_S = 1.0


async def run_import(order: Order, report: Report) -> tuple[int, str]:
    """Run it; the number of the version that it saved, and what its owner might not expect of it (empty: nothing).

    When it is cancelled the program is killed, and what was stored before is as it was.

    Raises:
        MapStoreError: the files are no map, or could not be saved.
    """
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "chefbotd.components.maps.storage.importing", order.model_dump_json()),
        stdin=asyncio.subprocess.DEVNULL,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.DEVNULL,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
        start_new_session=True,
        limit=MOST_LINE_BYTES,
    )
    assert process.stdout is not None  # noqa: S101 - it is a pipe
    message: dict[str, Any] = {}
    try:
        with repeat_report(report, "starts the program that imports it") as tell:
            async for line in process.stdout:
                message = json.loads(line)
                if "text" in message:
                    tell(message["done"], message["total"], message["text"])
            code = await process.wait()
    finally:
        send_signal(process, signal.SIGKILL)
        await process.wait()
    if "version" in message:
        return int(message["version"]), str(message.get("notes", ""))
    if "error" in message:
        raise MapStoreError(msgspec.convert(message["error"], RefusalKind), message["message"])
    raise MapStoreError(
        RefusalKind.MAP_UNREADABLE,
        Sentence(
            "maps.import_failed",
            "{file}: the program that reads it failed with exit code {code}",
            file=order.yaml,
            code=code,
        ),
    )


@contextmanager
def repeat_report(report: Report, text: str) -> Iterator[Report]:
    """Yields what reports; meanwhile the last report, ``text`` at first, is repeated, so that a client waits on."""
    latest = (0.0, 1.0, text)

    async def repeat() -> None:
        while True:
            await asyncio.sleep(REPEAT_S)
            report(*latest)

    def tell(done: float, total: float, text: str) -> None:
        nonlocal latest
        latest = done, total, text
        report(*latest)

    repeating = asyncio.create_task(repeat())
    try:
        yield tell
    finally:
        repeating.cancel()
