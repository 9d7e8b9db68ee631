"""A real robot's ticks through a pty and the running daemon, held against motion capture and plain integration.

One daemon, configured with that robot's geometry, takes every run in turn as ``t`` and ``e`` lines, as fast as the line
takes them; the counts and the board's time run on, the odometry is reset in between. The daemon and numpy must agree
within 1 mm and 0.1 degrees, and the wheels must have turned by exactly the recorded ticks: else something is wrong.

Beside these nominal errors stand those of a calibration (``wheel_calibration``), as a share of them.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import fmean
from typing import Any

import numpy as np

from benchmarks import wheel_calibration
from benchmarks.board import Board, board
from benchmarks.figures import Figure, Outcome
from benchmarks.rig import Changes, connect, daemon, until
from benchmarks.rpc import Caller
from benchmarks.ticks import Geometry, Run, apart, integrate, read_geometry, read_runs
from chefbotd.core.geometry import Pose2D

FOLDER = Path(__file__).parents[2] / "shared" / "data" / "optiodom"
AGREE_M, AGREE_DEG = 1e-3, 0.1
QUICK_RUNS = 4


@dataclass(frozen=True, slots=True)
class Replay:
    """What became of one run: errors against the truth and the distance of daemon and numpy, in metres and degrees."""

    name: str
    daemon: tuple[float, float]
    numpy: tuple[float, float]
    between: tuple[float, float]
    ticks_lost: int

    @property
    def fault(self) -> str | None:
        """What is wrong, if anything."""
        if self.ticks_lost:
            return f"{self.name}: {self.ticks_lost} ticks lost"
        if self.between[0] > AGREE_M or self.between[1] > AGREE_DEG:
            return f"{self.name}: daemon and numpy differ by {_shown(self.between)}"
        return None


def run(
    *,
    quick: bool = False,
    folder: Path = FOLDER,
    out: Path | None = None,
    fit: Path | None = None,
    score: Path | None = None,
) -> Outcome:
    """Replay every run (a few, when quick), and judge a calibration; without the folder nothing is measured.

    With ``fit`` or ``score`` only the calibration is judged: fitted to all runs of one folder, and tried on the other.
    ``out`` gets the calibrated trajectories and the parameters.
    """
    needed = folder if fit is None and score is None else fit or folder
    if not (needed / "geometry.json").is_file():
        return Outcome((), remarks=(f"skipped: no recordings in {needed}",))
    if needed is not folder or score is not None:
        return wheel_calibration.between_folders(needed, score or folder, out)
    replayed = _replayed(folder, quick=quick)
    calibrated = wheel_calibration.halves(folder, out, seeds=1 if quick else wheel_calibration.HALVES)
    return replace(replayed, figures=replayed.figures + calibrated.figures)


def _replayed(folder: Path, *, quick: bool) -> Outcome:
    geometry, runs = read_geometry(folder), list(read_runs(folder))
    if quick:
        runs = runs[:: max(len(runs) // QUICK_RUNS, 1)]
    changes = _configuration(geometry)
    with (
        board() as instrument,
        daemon(instrument.device, changes) as running,
        connect(running) as caller,
    ):
        feeder = _Feeder(instrument, caller, geometry)
        replays = [feeder.replay(each) for each in runs]
    return Outcome(
        _figures(replays),
        remarks=tuple(_told(replay) for replay in replays),
        faults=tuple(replay.fault for replay in replays if replay.fault),
    )


class _Feeder:
    """The board's side of all runs: its counts and its time run on from one to the next."""

    def __init__(self, instrument: Board, caller: Caller, geometry: Geometry) -> None:
        self._board, self._caller, self._geometry = instrument, caller, geometry
        self._counts = np.zeros(2, dtype=np.int64)
        self._frames = self._resets = 0

    def replay(self, run: Run) -> Replay:
        before_rad = self._frames and self._wheels_rad()
        self._caller.call("reset_odometry")
        self._resets += 1
        self._feed(run)
        pose = self._pose()
        turned_rad = np.subtract(self._wheels_rad(), before_rad)
        plain = integrate(self._geometry, run.ticks)
        counted = turned_rad * self._geometry.ticks_per_revolution / math.tau
        return Replay(
            run.name,
            daemon=_degrees(apart(pose, run.truth)),
            numpy=_degrees(apart(plain, run.truth)),
            between=_degrees(apart(pose, plain)),
            ticks_lost=int(np.abs(np.rint(counted) - run.ticks.sum(axis=0)).sum()),
        )

    def _feed(self, run: Run) -> None:
        counts = self._counts + np.cumsum(run.ticks, axis=0)
        cycle_s = self._geometry.cycle_s
        cycle_us = round(cycle_s * 1e6)
        lines = [
            f"t\t{(self._frames + row) * cycle_us}\t{cycle_s:.2f}\ne\t{left}\t{right}\n"
            for row, (left, right) in enumerate(counts.tolist(), start=1)
        ]
        self._board.feed("".join(lines).encode())
        self._counts = counts[-1]
        self._frames += len(lines)

    def _pose(self) -> Pose2D:
        """The odometry, once it has taken the last frame in: it speaks once a frame and once a reset."""
        until(lambda: self._topic("odometry")["seq"] >= self._frames + self._resets, "frames are missing")
        data = self._topic("odometry")["data"]
        return Pose2D(data["x_m"], data["y_m"], data["heading_rad"])

    def _wheels_rad(self) -> list[float]:
        positions: list[float] = self._topic("wheels")["data"]["position_rad"]
        return positions

    def _topic(self, name: str) -> dict[str, Any]:
        state = self._caller.call("get_state")["topics"]
        topic: dict[str, Any] = state.get(name, {"seq": 0})
        return topic


def _configuration(geometry: Geometry) -> Changes:
    wheels = [
        {"name": f"{side}_wheel", "side": side, "radius_m": geometry.wheel_diameter_m / 2}
        for side in ("left", "right")
    ]
    return {
        "chassis": {"track_width_m": geometry.wheel_base_m, "wheels": wheels},
        "encoders": {"counts_per_turn": geometry.ticks_per_revolution},
    }


def _figures(replays: list[Replay]) -> tuple[Figure, ...]:
    return (
        Figure(
            "daemon and numpy, furthest apart", max(r.between[0] for r in replays) * 1e3, "mm", AGREE_M * 1e3
        ),
        Figure("daemon and numpy, furthest apart", max(r.between[1] for r in replays), "deg", AGREE_DEG),
        Figure("ticks lost", sum(r.ticks_lost for r in replays), "ticks", 0),
        *_errors("daemon", [r.daemon for r in replays]),
        *_errors("numpy", [r.numpy for r in replays]),
    )


def _errors(who: str, errors: Iterable[tuple[float, float]]) -> tuple[Figure, ...]:
    metres, degrees = zip(*errors, strict=True)
    return (
        Figure(f"{who} against truth, mean of {len(metres)} runs", fmean(metres) * 1e3, "mm"),
        Figure(f"{who} against truth, mean of {len(metres)} runs", fmean(degrees), "deg"),
        Figure(f"{who} against truth, worst", max(metres) * 1e3, "mm"),
    )


def _degrees(difference: tuple[float, float]) -> tuple[float, float]:
    return difference[0], math.degrees(difference[1])


def _shown(error: tuple[float, float]) -> str:
    return f"{error[0] * 1e3:.3f} mm, {error[1]:.3f} deg"


def _told(replay: Replay) -> str:
    return f"{replay.name}: daemon {_shown(replay.daemon)}; numpy {_shown(replay.numpy)}"
