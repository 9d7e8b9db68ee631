"""Checks of how long a request and a motor command take."""

from collections.abc import Sequence

from chefbotd.components.doctor.algorithms.finding import Finding, ok, skip_check, warning

SLOW_S, SLOW_ECHO_S = 0.02, 0.15
LEAST_SAMPLES = 10


def percentile(values: Sequence[float], share: float) -> float:
    """The value that this share of the values does not exceed (nearest rank)."""
    ordered = sorted(values)
    return ordered[min(int(share * len(ordered)), len(ordered) - 1)]


def check_latency(round_trips_s: Sequence[float], loop_lag_s: float | None) -> Finding:
    """Round trips of requests through the socket, and the lag of the daemon's own loop."""
    if len(round_trips_s) < LEAST_SAMPLES:
        return skip_check("latency", "too few requests were answered")
    middle, most = percentile(round_trips_s, 0.5), percentile(round_trips_s, 0.99)
    lag = "" if loop_lag_s is None else f"; its loop was late by {loop_lag_s * 1e3:.1f} ms at most"
    text = (
        f"a request takes {middle * 1e3:.1f} ms (median) and {most * 1e3:.1f} ms (99 of 100), of "
        f"{len(round_trips_s)}{lag}"
    )
    if most <= SLOW_S and (loop_lag_s or 0.0) <= SLOW_S:
        return ok("latency", text)
    return warning(
        "latency",
        text,
        "see what else runs ('top'), set the CPU governor to performance, and use a cable rather than Wi-Fi",
    )


def check_echo(delays_s: Sequence[float]) -> Finding:
    """From a motor command on the wire to the board's echo of it."""
    if not delays_s:
        return skip_check("command_latency", "no motor command was echoed")
    middle, most = percentile(delays_s, 0.5), max(delays_s)
    text = (
        f"a motor command is in force after {middle * 1e3:.0f} ms (median), {most * 1e3:.0f} ms at most, of "
        f"{len(delays_s)}"
    )
    if middle <= SLOW_ECHO_S:
        return ok("command_latency", text)
    return warning(
        "command_latency",
        text,
        "the board's loop is slow: a missing ultrasonic echo holds it up to a second; is the sensor plugged in?",
    )
