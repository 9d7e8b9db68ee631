"""What comes in on the port, be it a board or not: counted, sampled, and judged once in a while."""

from chefbotd.link.health import Health, HealthWatch, Heard
from firmware_protocol.decoder import Decoder
from firmware_protocol.messages import Text

SAMPLE_BYTES = 128


class LinkMonitor:
    """Listens beside the decoder, which has seen the same bytes."""

    def __init__(self, decoder: Decoder, *, health_after_s: float) -> None:
        self._decoder, self._judged_after_s = decoder, health_after_s
        self._sample = b""
        self.bytes_in = 0
        self.begin(0.0)

    def begin(self, now_s: float) -> None:
        """A port was opened: nothing is known of it yet."""
        self._before = self._heard()
        self._watch = HealthWatch(now_s, self._before, health_after_s=self._judged_after_s)

    def count_bytes(self, data: bytes) -> None:
        """Bytes that have come in."""
        self.bytes_in += len(data)
        self._sample = (self._sample + data)[-SAMPLE_BYTES:]

    @property
    def proven(self) -> bool:
        """Whether a frame has come in since the port was opened."""
        return self._heard().since(self._before).frames > 0

    def judge(self, now_s: float, complaint: str = "") -> Health | None:
        """What the port sounds like, if that has changed; ``complaint``: what is wrong with the echo."""
        return self._watch.look(now_s, self._heard(), self._sample, complaint)

    def _heard(self) -> Heard:
        frames, refused = self._decoder.accepted, self._decoder.malformed.total()
        lines = sum(frames.values())
        return Heard(self.bytes_in, lines + refused, lines - frames.get(Text.__name__, 0))
