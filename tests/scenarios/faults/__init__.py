"""The table of faults: how each happens to the simulated robot, and the one outcome that it may have."""

from tests.scenarios.faults import board, driver, guards, link, other_clients, program, rearm, wheels

FAULTS = (
    *driver.FAULTS,
    *wheels.FAULTS,
    *program.FAULTS,
    *link.FAULTS,
    *board.FAULTS,
    *rearm.FAULTS,
    *other_clients.FAULTS,
    *guards.FAULTS,
)
