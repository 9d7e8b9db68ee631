"""The line that ``systemctl status chefbotd`` shows: mode, board, clients, fault."""

from collections.abc import Callable

from chefbotd.bus import Bus
from chefbotd.core.events import SafetyChanged


class StatusLine:
    """Keeps the last word about safety; the rest is asked when the line is made."""

    def __init__(
        self, bus: Bus, device: str, link_is_up: Callable[[], bool], clients: Callable[[], int]
    ) -> None:
        self._device, self._link_is_up, self._clients = device, link_is_up, clients
        self._mode, self._fault = "starting", ""
        self.where = self.note = ""
        bus.add_handler(self._on_safety, SafetyChanged)

    def __call__(self) -> str:
        """The line; ``where`` is the socket's address, ``note`` what happened last, such as a reload."""
        link = f"board on {self._device}" if self._link_is_up() else f"no board on {self._device}"
        clients = self._clients()
        parts = [
            self._mode,
            link,
            f"{clients} client" if clients == 1 else f"{clients} clients",
            f"fault: {self._fault}" if self._fault else "no fault",
            f"listening on {self.where}",
            self.note,
        ]
        return "; ".join(filter(None, parts))

    def _on_safety(self, event: SafetyChanged) -> None:
        self._mode, self._fault = event.mode, event.fault or ""
