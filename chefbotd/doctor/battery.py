"""The battery, by its volts."""

from chefbotd.doctor.finding import Finding, ok, problem, skipped, warning


def check_battery(
    voltage_v: float | None,
    status: str,
    *,
    sends_battery: bool,
    absent_below_v: float,
    low_v: float,
    critical_v: float,
) -> Finding:
    """Whether there is charge enough to drive."""
    if voltage_v is None:
        if sends_battery:
            return problem("battery", "no voltage could be read", "see the finding on damaged lines")
        return skipped("battery", "the board sends no 'b' lines", "sketch C never does: measure it by hand")
    told = f"the battery has {voltage_v:.2f} V"
    if voltage_v < absent_below_v:
        return warning(
            "battery",
            f"{told}: nothing seems to be wired to the pin",
            "wire the divider, or take it as it is",
        )
    if status == "critical" or voltage_v <= critical_v:
        return problem("battery", f"{told}: it is flat (critical at {critical_v:g} V)", "charge it now")
    if status == "low" or voltage_v <= low_v:
        return warning("battery", f"{told}: it is low (low at {low_v:g} V)", "charge it soon")
    return ok("battery", told)
