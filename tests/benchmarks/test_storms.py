"""What the storms say of memory."""

from benchmarks.storms import outcome_of


def test_what_grew_and_what_has_ended_is_said() -> None:
    """Sixteen samples: the daemon stands at 100 MB from its start on, the manager gains 1 MB in each second."""
    samples = [{"daemon": 100.0 if k else 80.0, "manager": 50.0 + k} for k in range(16)]
    outcome = outcome_of(samples, 0.25, 7, ("agent has ended",))
    grown = {figure.name: figure.value for figure in outcome.figures if figure.name.endswith("grown")}
    assert grown == {"daemon: grown": 0.0, "manager: grown": 8.0}
    assert outcome.faults == ("agent has ended",)
    assert outcome.remarks == ("7 storms in 0.25 minutes", "left out: agent, rosbridge, worker")
    steeper = [{"manager": 50.0 + 2 * k} for k in range(16)]
    assert outcome_of(steeper, 0.25, 7, ()).faults == ("manager grew by 16.0 MB",)
