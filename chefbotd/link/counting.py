"""Whose encoder counts the configuration has: our firmware counts all four edges, the published sketches one of them.

A board that counts otherwise than is configured would drive at four times, or a quarter of, the speed that is asked for.
"""

from chefbotd.core.record import Record

EDGES = 4


class Counting(Record, frozen=True):
    """The configured counts of a turn, and whether they are our firmware's."""

    counts_per_turn: float
    by_firmware: bool

    @property
    def difference(self) -> str:
        """What is wrong with a board of the other kind, and what to set."""
        counts = self.counts_per_turn
        if self.by_firmware:
            return (
                f"the configured counts of a wheel's turn, {counts:g}, are our firmware's, which counts all four edges, "
                "and the board has not named itself as that: the motors stay off. "
                f"{_advice('sketch', counts / EDGES, 'our firmware')}"
            )
        return (
            "the board runs our firmware, which counts all four edges of the encoders, and the configured counts of a "
            f"wheel's turn, {counts:g}, are a sketch's, which counts one: the motors stay off. "
            f"{_advice('firmware', EDGES * counts, 'the sketch')}"
        )


def _advice(counted_by: str, counts: float, measured_with: str) -> str:
    """What to do: nobody is to compute with a number that was never measured."""
    return (
        f"Configure the encoders as counted by the {counted_by}, then calibrate them by turning a wheel ten times by "
        "hand, and set what that finds. Only if the configured counts were measured with "
        f"{measured_with}, and not assumed, are they {counts:g} now"
    )
