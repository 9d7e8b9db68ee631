"""The events on the bus, each named in the past tense.

``stamp_s`` is when it happened, on the host's monotonic clock. Of a measurement that is when it was made: the board's
time, mapped to the host's clock, or the time of reading where the board does not tell its time. ``arrival_s``, beside it
in every measurement, is when its bytes were read, never before ``stamp_s``: by it the guards tell whether a sensor is
silent. ``board_s`` is the board's own time, unwrapped, in seconds; only differences of it mean anything.

Attributes of the class say how others treat its events. ``retained``: new subscribers get the last one.
``log_line()``: the line in the log. ``recorded_as``: the channel in a recording, if it is not the class's name.
``drawn_as``: what a viewer of a recording is shown of it: ``odometry``, ``odometry_reset``, ``map_pose``, ``scan``,
``map``, ``path`` or ``picture``. ``encode_recorded()``: the event as it is recorded, if it is not whole.
"""

from chefbotd.core.events.board import *
from chefbotd.core.events.robot import *
