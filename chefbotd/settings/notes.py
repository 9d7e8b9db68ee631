"""What a valid configuration leaves out that somebody who relies on it should know, a sentence each."""

from collections.abc import Iterator

from chefbotd.core.sentence import Sentence, join_words
from chefbotd.settings.model import Settings


def notes(settings: Settings) -> Iterator[str]:
    """The sentences; ``check-config`` and the start of the daemon say them."""
    if warning := guard_warning(settings):
        yield warning
    if settings.lidar and settings.body is None:
        yield (
            "a lidar, and no [body]: the obstacle guard and navigation take the box about the wheels for the robot's "
            "outline; measure the robot with all that sticks out, and say its length_m, width_m and height_m in [body]"
        )


def guard_warning(settings: Settings) -> str:
    """That sensors see obstacles while the obstacle guard is off; empty where it is on, or nothing sees any."""
    if settings.safety.guard.enabled:
        return ""
    seeing = {
        "a lidar": [lidar.name for lidar in settings.lidar],
        "an ultrasonic": [] if settings.ultrasonic is None else [settings.ultrasonic.name],
        "an infrared sensor": [sensor.name for sensor in settings.infrared],
    }
    for scanner in settings.further_scanners:
        seeing.setdefault(f"a {scanner.kind}", []).append(scanner.name)
    sensors = [f"{kind} ({', '.join(names)})" for kind, names in seeing.items() if names]
    if not sensors:
        return ""
    return Sentence(
        "driving.guard_off",
        "{sensors}, and the guard is off: nothing stops the robot before what is seen; delete "
        "enabled = false in [safety.guard]",
        sensors=join_words(sensors),
    )
