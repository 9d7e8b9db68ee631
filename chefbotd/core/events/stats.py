"""What the daemon has counted."""

from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True)
class StatsSampled:
    """Counters since the daemon started, and the worst of the last second, sampled once a second.

    ``frames`` counts accepted lines by message name, ``refused`` the malformed ones by reason, ``bus_dropped`` events
    given up by class, ``handler_faults`` requests that broke their handler by method, ``clients_refused`` connections
    that the socket refused or ended by the kind of error, ``void_commands`` commands that came before a stop or waited
    too long, by the kind of error, ``internal_errors`` control steps that failed,
    ``service_failures`` services that were started again, by name. ``loop_lag_s`` is the latest the event loop
    was to a timer in the last second.
    """

    stamp_s: float
    uptime_s: float
    frames: dict[str, int]
    refused: dict[str, int]
    lines_out: int
    setpoints_replaced: int
    link_opens: int
    board_restarts: int
    encoder_readings_refused: int
    control_steps: int
    bus_dropped: dict[str, int]
    clients: int
    telemetry_dropped: int
    loop_lag_s: float
    board_clock_skew_ppm: float | None
    board_clock_jitter_s: float | None
    clients_refused: dict[str, int] = field(default_factory=dict)
    handler_faults: dict[str, int] = field(default_factory=dict)
    void_commands: dict[str, int] = field(default_factory=dict)
    internal_errors: int = 0
    service_failures: dict[str, int] = field(default_factory=dict)
    board_clock_suspects: int = 0
    encoder_transitions_illegal: int = 0
    encoder_levels_repeated: int = 0
    encoder_edges_lost: int = 0
    bytes_in: int = 0
