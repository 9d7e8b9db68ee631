"""Replays the files of a recording with its own configuration, or with another one."""

import asyncio
import time
from collections.abc import Callable, Iterable, Sequence
from functools import wraps
from itertools import chain
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import msgspec
from msgspec import Struct
from msgspec.structs import replace
from pydantic import ValidationError

from chefbotd.app import Daemon
from chefbotd.components.recording.parameters import RecordingParameters
from chefbotd.components.recording.replay.build import replayed_daemon
from chefbotd.components.recording.replay.entries import ReplayEntries
from chefbotd.components.recording.replay.pipeline import NOT_HANDLED
from chefbotd.components.recording.replay.recorded import (
    EntryGroup,
    NotReplayable,
    RecordingFiles,
    from_beginning,
    groups_of,
)
from chefbotd.components.recording.replay.replay import Replay, ReplayOutcome, ReplayPace
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.events.inputs import DaemonStarted
from chefbotd.rpc.method import Method
from chefbotd.sensing.lidar import LidarParameters
from chefbotd.settings import Settings
from chefbotd.settings.errors import explain, with_new_names
from chefbotd.settings.retired import RetiredKey, drop_retired
from chefbotd.settings.sections import fixed_sections, model_for

LOOKING = NOT_HANDLED | {"set_client_name", "get_pid", "get_description"}
WHY = "this is a replay: it cannot be driven, stopped or changed"


class Serving:
    """The daemon's socket and page, as long as the context lasts."""

    def __init__(self, daemon: Daemon) -> None:
        self._daemon = daemon
        self._tasks: list[asyncio.Task[None]] = []

    async def __aenter__(self) -> Self:
        daemon = self._daemon
        daemon.rpc.exchange_methods(_guard_method)
        loops = [daemon.rpc.run, daemon.server.run, *([daemon.page.run] if daemon.page is not None else [])]
        self._tasks = [asyncio.create_task(loop()) for loop in loops]
        await daemon.server.address()
        if daemon.page is not None:
            await daemon.page.address()
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)


def _guard_method(method: Method) -> Method:
    if method.name in LOOKING:
        return method
    return replace(method, handle=_refusing(method.handle))


def _refusing(handle: Callable[..., Any]) -> Callable[..., Any]:
    @wraps(handle)
    def refuse(*arguments: object) -> None:
        raise Refused(RefusalKind.DISARMED, WHY)

    return refuse


class ReplayOptions(Struct, frozen=True):
    """``other`` is another configuration. ``rate`` is the speed, 1.0 the recorded one; None: as fast as it can.

    ``listen`` is where the socket and the page show it; ``any_version`` replays what another version recorded.
    """

    other: Settings | None = None
    rate: float | None = None
    listen: tuple[str, int] | None = None
    any_version: bool = False


class Replayed(Struct, frozen=True):
    """What came of it. ``problem`` says where reading the files ended early."""

    robot: str
    outcome: ReplayOutcome
    took_s: float
    problem: str | None


def replay_files(paths: Sequence[Path], wishes: ReplayOptions) -> Replayed:
    """Replay a recording, in an event loop of its own.

    Raises:
        NotReplayable: the text says why.
    """
    files = RecordingFiles(paths)
    configuration = files.configuration
    if not wishes.any_version:
        files.require_version()
    recorded = settings_of(configuration)
    settings = recorded if wishes.other is None else other_settings(recorded, wishes.other)
    before, groups = from_beginning(groups_of(files.messages()))
    first = next(groups, None)
    if first is None:
        raise NotReplayable(
            f"{paths[0]}: nothing came in while it was recorded, or the file was cut off before: "
            f"{files.problem or 'it has no entry'}"
        )
    began_s = time.monotonic()
    outcome = asyncio.run(replay_groups(settings, first, groups, wishes))
    outcome.skipped_s = first.entry.stamp_s - before[0].entry.stamp_s if before else 0.0
    return Replayed(settings.robot.name, outcome, time.monotonic() - began_s, files.problem)


async def replay_groups(
    settings: Settings, first: EntryGroup, others: Iterable[EntryGroup], wishes: ReplayOptions
) -> ReplayOutcome:
    """Replay the first entry and the others; shown on a socket, where one is wished for, at the loop's time."""
    entries = ReplayEntries()
    entries.set_time(first.entry.stamp_s)
    started = first.entry if isinstance(first.entry, DaemonStarted) else None
    daemon = replayed_daemon(settings, started, entries, listen=wishes.listen)
    replay = Replay(
        daemon,
        entries,
        own_timers=wishes.other is not None,
        any_state=wishes.any_version,
        left_out=settings.of("recording", RecordingParameters).exclude,
    )
    rate = wishes.rate or (1.0 if wishes.listen is not None else None)
    groups = chain((first,), others)
    pace = None if rate is None else ReplayPace(rate, asyncio.get_running_loop().time)
    if wishes.listen is None:
        return await replay.run(groups, pace)
    async with Serving(daemon):
        return await replay.run(groups, pace)


OTHER_VERSION = "the configuration in the recording is not one of this version"
THAT_VERSION = "the version that recorded it replays it ('chefbotctl log info' tells which)"


def settings_of(configuration: str) -> Settings:
    """The configuration in a recording.

    Raises:
        NotReplayable: this version does not understand it.
    """
    try:
        recorded = with_new_names(msgspec.json.decode(configuration, type=dict[str, Any]))
        model = model_for(recorded, Settings)
        drop_retired(model, recorded)
        return model.model_validate_json(msgspec.json.encode(recorded), strict=True)
    except RetiredKey as error:
        raise NotReplayable(f"{OTHER_VERSION}: {error}; {THAT_VERSION}") from error
    except ValidationError as error:
        wrong = explain(error, model, recorded, {}, "").replace("\n", "; ")
        raise NotReplayable(f"{OTHER_VERSION}: {wrong[:500]}; {THAT_VERSION}") from error
    except (ValueError, RecursionError) as error:
        raise NotReplayable(f"the configuration in the recording is no JSON: {error}") from error


def other_settings(recorded: Settings, other: Settings) -> Settings:
    """Another configuration, with the devices, the socket and the maps of the recording.

    Raises:
        NotReplayable: it is for another board, so the recorded bytes mean nothing to it.
    """
    if other.robot.wire != recorded.robot.wire:
        raise NotReplayable(
            f"the other configuration is for the wire {str(other.robot.wire)!r}, "
            f"and the recording is of {str(recorded.robot.wire)!r}"
        )
    return other.model_copy(
        update={
            "link": recorded.link,
            "lidar": tuple(_with_device(lidar, recorded) for lidar in other.lidar),
            "api": recorded.api,
            **fixed_sections(recorded),
        }
    )


def _with_device(lidar: LidarParameters, recorded: Settings) -> LidarParameters:
    device = next(
        (candidate.device for candidate in recorded.lidar if candidate.name == lidar.name), lidar.device
    )
    return lidar.model_copy(update={"device": device})
