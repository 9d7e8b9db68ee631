"""The ATmega328P's image in simavr, for the tests: lines in and out, and what the motors get."""

from functools import cache

from chefbotd.components.simulation.simavr import CYCLES_S, IMAGE, DutyChange, SimavrBoard
from tests.firmware import tools
from tests.firmware.host import seal, unsealed

BOOT_S = 0.1
EDGES_STEP_S = 0.005


@cache
def built() -> None:
    """The image and the emulator, built if their sources are newer."""
    tools.need("gcc", "make", "avr-gcc")
    tools.need_header("simavr/sim_avr.h", "libsimavr-dev libelf-dev")
    tools.make("boards")
    tools.make("emulators")


class Emulated:
    """A board that was powered on at time 0 and has sent its banner.

    ``text`` is what it has sent since `forget`, ``duties`` every change of the duty since the power came on.
    """

    def __init__(
        self,
        *,
        image: str = IMAGE,
        echo_us: int = 0,
        imu: tuple[int, ...] | None = None,
        boot_s: float = BOOT_S,
    ) -> None:
        built()
        counts = (0,) * 6 if imu is None else imu
        self.board = SimavrBoard(tools.BUILD, image=image, echo_us=lambda: echo_us, imu_counts=lambda: counts)
        self.board.set_imu(imu is not None)
        self.now_s = 0.0
        self.text = ""
        self.duties: list[DutyChange] = []
        self.turned = [0, 0]
        self._sequence = 0
        self.run(boot_s)

    def run(self, duration_s: float, *, edges_s: tuple[int, int] = (0, 0)) -> None:
        """Let time go on, while the wheels turn at so many edges a second, forward positive."""
        for _ in range(round(duration_s / EDGES_STEP_S)):
            self._turn([round(rate * EDGES_STEP_S) for rate in edges_s])
            self.run_to(self.now_s + EDGES_STEP_S)

    def run_to(self, to_s: float) -> None:
        """Let time go on."""
        self.now_s = to_s
        self.board.run(round(to_s * CYCLES_S))
        self.text += bytes(sent.byte for sent in self.board.take_bytes()).decode("latin-1")
        self.duties += self.board.take_duties()

    def _turn(self, edges: list[int]) -> None:
        begin, end = (round(at_s * CYCLES_S) for at_s in (self.now_s, self.now_s + EDGES_STEP_S))
        for wheel, count in enumerate(edges):
            if count:
                before = self.turned[wheel]
                self.board.turn(wheel, before, before + count, begin, end)
                self.turned[wheel] = before + count

    def write(self, text: str) -> float:
        """Put a line and its CR on the wire now; gives when its last byte is in."""
        self.board.receive(text.encode("latin-1") + b"\r", round(self.now_s * CYCLES_S))
        return self.now_s + (len(text) + 1) * 10 / 115_200

    def seal(self, body: str) -> float:
        """The same with sequence number and CRC."""
        number, self._sequence = self._sequence, (self._sequence + 1) % 256
        return self.write(seal(f"{body} {number}"))

    def hello(self, deadman_ms: int = 250) -> None:
        """Begin the checked mode, and forget what came before its answer."""
        self.seal(f"hello 1 {deadman_ms}")
        self.run(0.03)
        self.text = self.text[self.text.rindex("hello\t") :]

    @property
    def lines(self) -> list[str]:
        """The whole lines since `forget`."""
        return [line for line in self.text.replace("\r", "").split("\n")[:-1] if line]

    def fields(self, kind: str) -> list[list[str]]:
        """The fields of the sealed lines of one kind, without sequence number; raises AssertionError for a wrong CRC."""
        sealed = [line for line in self.lines if line.startswith(f"{kind}\t")]
        return [unsealed(line).split("\t")[1:-1] for line in sealed]

    def forget(self) -> None:
        """Look at later lines only; the rest of a line that is being sent is left out too."""
        self.text = ""

    def changed_s(self, duty: tuple[int, int], since_s: float) -> float:
        """When the motors first got this duty after a time."""
        return next(
            change.at_cycle / CYCLES_S
            for change in self.duties
            if change.duty == duty and change.at_cycle / CYCLES_S >= since_s
        )
