"""The text of the figures, as Prometheus' own parser reads it."""

import pytest

from chefbotd.metrics import Histogram, Metrics

parser = pytest.importorskip("prometheus_client.parser", reason="the figures' text needs the extra 'page'")
from chefbotd.transport.web.prometheus import exposition  # noqa: E402


def samples(metrics: Metrics) -> dict[tuple[str, tuple[tuple[str, str], ...]], float]:
    """Every sample by its name and labels."""
    return {
        (sample.name, tuple(sample.labels.items())): sample.value
        for family in parser.text_string_to_metric_families(exposition(metrics).decode())
        for sample in family.samples
    }


def test_a_histogram_is_cumulative_with_count_and_sum() -> None:
    """Of 0.5, 1.5, 1.5 and 9, one is at most 1, three are at most 2, and all four are counted."""
    metrics, histogram = Metrics(), Histogram((1.0, 2.0))
    metrics.histogram("lag_s", "How late.", histogram)
    for value in (0.5, 1.5, 1.5, 9.0):
        histogram.observe(value)
    assert samples(metrics) == {
        ("chefbotd_lag_s_bucket", (("le", "1.0"),)): 1.0,
        ("chefbotd_lag_s_bucket", (("le", "2.0"),)): 3.0,
        ("chefbotd_lag_s_bucket", (("le", "+Inf"),)): 4.0,
        ("chefbotd_lag_s_count", ()): 4.0,
        ("chefbotd_lag_s_sum", ()): 12.5,
    }


def test_a_label_is_escaped_and_an_unknown_figure_has_no_sample() -> None:
    """A quote and a line end in a reason break no line of the text."""
    metrics = Metrics()
    metrics.counters("refused", "Lines.", "reason", lambda: {'odd "one"\n': 2})
    metrics.optional_gauge("battery_v", "Volts.", lambda: None)
    assert samples(metrics) == {("chefbotd_refused_total", (("reason", 'odd "one"\n'),)): 2.0}
