"""The table of faults: how each happens to the simulated robot, and the one outcome that it may have."""

from tests.scenarios.faults import board, driver, guards, link, program, rearm, strangers, wheels

FAULTS = (
    *driver.FAULTS,
    *wheels.FAULTS,
    *program.FAULTS,
    *link.FAULTS,
    *board.FAULTS,
    *rearm.FAULTS,
    *strangers.FAULTS,
    *guards.FAULTS,
)
