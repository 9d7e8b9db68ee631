"""The daemon as a systemd service: status, watchdog messages, and a reload on SIGHUP."""

import asyncio
import os
import time
from collections.abc import Awaitable, Callable, Mapping
from functools import partial

import structlog

from chefbotd.app import Daemon, Loop
from chefbotd.bus import Bus
from chefbotd.core.events import SafetyChanged
from chefbotd.core.events.inputs import GainsExchanged, LimitsExchanged
from chefbotd.motion.limits import MotionLimits
from chefbotd.motion.pid import PidParameters
from chefbotd.process import keep_alive, logs
from chefbotd.process.keep_alive import KeepAlive, watchdog_s_of
from chefbotd.process.reload import CANNOT_RELOAD, Reloader
from chefbotd.rpc.access import Keyring, load_guard, renew_certificate
from chefbotd.settings import Settings
from chefbotd.settings.model import Level


class StatusLine:
    """Keeps the latest state of safety for the status line; the rest is read when the line is made."""

    def __init__(
        self, bus: Bus, device: str, link_is_up: Callable[[], bool], clients: Callable[[], int]
    ) -> None:
        self._device, self._link_is_up, self._clients = device, link_is_up, clients
        self._mode, self._fault = "starting", ""
        self.where = self.note = self.priority = ""
        bus.add_handler(self._on_safety, SafetyChanged)

    def __call__(self) -> str:
        """The line; ``where`` is the socket's address, ``priority`` the loop's, ``note`` what happened last."""
        link = f"board on {self._device}" if self._link_is_up() else f"no board on {self._device}"
        clients = self._clients()
        parts = [
            self._mode,
            link,
            f"{clients} client" if clients == 1 else f"{clients} clients",
            f"fault: {self._fault}" if self._fault else "no fault",
            f"listening on {self.where}",
            self.priority,
            self.note,
        ]
        return "; ".join(filter(None, parts))

    def _on_safety(self, event: SafetyChanged) -> None:
        self._mode, self._fault = event.mode, event.fault or ""


log = structlog.get_logger(component="service")

Load = Callable[[], Settings]
Read = Callable[[], Awaitable[Settings]]


class DaemonTarget:
    """The parts of the running daemon that a reload changes."""

    def __init__(self, daemon: Daemon) -> None:
        self._daemon = daemon
        self.gains = daemon.driving.wheels.gains
        self.exchange_tokens = daemon.rpc.exchange_tokens

    def exchange_gains(self, gains: Mapping[str, PidParameters]) -> None:
        """Change the gains without a jump in the duty."""
        recorded = {name: own.model_dump(mode="json") for name, own in gains.items()}
        with self._daemon.entries.entry(GainsExchanged, recorded):
            self._daemon.driving.wheels.retune(gains)

    def exchange_limits(self, limits: MotionLimits) -> bool:
        """Change the limits as soon as the robot stands, and with them the answers to commands."""

        def tell() -> None:
            log.info("the limits have changed")

        with self._daemon.entries.entry(LimitsExchanged, limits.model_dump(mode="json")):
            return self._daemon.driving.wheels.relimit(limits, tell)

    def set_level(self, level: Level) -> None:
        """Set the level of the whole process, but not of the worker."""
        logs.set_level(level)

    def load_keyring(self, settings: Settings) -> Keyring | None:
        """Read the tokens from where the daemon had them at its start. What systemd passed does not change."""
        if not self._daemon.rpc.asks_for_tokens:
            return None
        return load_guard(settings.api, os.environ).keyring

    def renew_certificate(self, settings: Settings) -> bool:
        """Read the certificate from where the daemon had it at its start."""
        context = self._daemon.tls
        if context is not None:
            renew_certificate(context, settings.api)
        return context is not None


class DaemonService:
    """``read`` reads the configuration again; ``tell`` brings a message to systemd."""

    def __init__(
        self,
        daemon: Daemon,
        settings: Settings,
        read: Read,
        tell: Callable[[str], object] = keep_alive.notify,
        watchdog_s: float | None = None,
    ) -> None:
        device = settings.link.device
        session = daemon.session
        self.status = StatusLine(
            daemon.bus, device, lambda: session.is_open, lambda: len(daemon.rpc.connections)
        )
        self._tell, self._read = tell, read
        self._keep_alive = KeepAlive(daemon.driving, session, tell, self.status, watchdog_s)
        self._reloader = Reloader(settings, DaemonTarget(daemon))
        self._reload_requested = asyncio.Event()

    @property
    def loops(self) -> tuple[Loop, ...]:
        """Run beside the daemon until cancelled."""
        return (self._keep_alive.run, self._reload_when_wanted)

    def want_reload(self) -> None:
        """Read the configuration again soon. Several requests before then count as one."""
        self._reload_requested.set()

    def report_ready(self, where: str) -> None:
        """The daemon serves at this address."""
        self.status.where = where
        self._tell(f"READY=1\nSTATUS={self.status()}")

    async def _reload_when_wanted(self) -> None:
        while True:
            await self._reload_requested.wait()
            self._reload_requested.clear()
            await self.reload()

    async def reload(self) -> None:
        """Apply what may change, and log the result."""
        self._tell(f"RELOADING=1\nMONOTONIC_USEC={time.clock_gettime_ns(time.CLOCK_MONOTONIC) // 1000}")
        try:
            outcome = self._reloader.apply(await self._read())
        except CANNOT_RELOAD as error:
            self.status.note = "reload failed, nothing has changed: see the log"
            log.error("the configuration was not reloaded, and nothing has changed", error=str(error))
        except Exception as error:  # told: no file may end a daemon whose robot drives
            self.status.note = "reload failed: see the log"
            log.error("the configuration was not reloaded", error=repr(error), exc_info=error)
        else:
            self.status.note = f"reloaded: {outcome}"
            write = log.warning if outcome.refused else log.info
            write(
                "the configuration was reloaded",
                changed=outcome.changed,
                waiting=outcome.waiting,
                refused=outcome.refused,
            )
        self._tell(f"READY=1\nSTATUS={self.status()}")


def service_of(daemon: Daemon, settings: Settings, load: Load | None) -> DaemonService | None:
    """Whether SIGHUP means reload: only under systemd; elsewhere it means that the terminal closed.

    The configuration is read in a thread: control goes on meanwhile.
    """
    if load is None or not keep_alive.is_listening():
        return None
    return DaemonService(
        daemon, settings, partial(asyncio.to_thread, load), watchdog_s=watchdog_s_of(os.environ)
    )
