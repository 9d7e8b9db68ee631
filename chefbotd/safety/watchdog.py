"""How long the control loop may stand still before a thread stops the motors (``chefbotd.process.watchdog``)."""

from pydantic import Field

from chefbotd.core.parameters import Parameters


class WatchdogParameters(Parameters):
    """``timeout_s``: how long the control loop may stand still before the motors are stopped."""

    timeout_s: float = Field(default=0.25, ge=0.1, le=5)
