"""The table of faults: how each happens to the simulated robot, and the one outcome that it may have."""

from tests.scenarios.faults import (
    board,
    driver,
    guards,
    lidars,
    link,
    other_clients,
    program,
    rearm,
    wheels,
    worker,
)

BOARD_FAULTS = (*driver.FAULTS, *wheels.FAULTS, *link.FAULTS, *board.FAULTS, *rearm.FAULTS)
"""What comes of them depends on the board: on its lines, its rate, and when it obeys. They are tried on each sketch."""

PROGRAM_FAULTS = (
    *program.FAULTS,
    *other_clients.FAULTS,
    *guards.FAULTS,
    *lidars.FAULTS,
    *worker.FAULTS,
)
"""They happen in the program or on its socket, and end in a stop or in nothing: no sketch makes a difference to them."""

FAULTS = (*BOARD_FAULTS, *PROGRAM_FAULTS)
