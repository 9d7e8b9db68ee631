"""The wheels' parameters fitted to recorded ticks with truth, and judged on runs that the fit has not seen.

``chefbotd.components.calibration.algorithms.wheel_fit`` does the fitting. Runs of a folder are halved (by run, seeded),
or one folder is fitted and another one judged.
"""

import json
import math
from collections.abc import Sequence
from pathlib import Path
from statistics import fmean

import numpy as np

from benchmarks.figures import Figure, Outcome
from benchmarks.ticks import Geometry, Run, read_geometry, read_runs
from chefbotd.components.calibration.algorithms.least_squares import Floats
from chefbotd.components.calibration.algorithms.wheel_fit import (
    RecordedDrive,
    WheelFit,
    fit,
    in_pieces,
    needs_rich,
)
from chefbotd.components.calibration.algorithms.wheel_model import NOMINAL, WheelModel, dead_reckon
from chefbotd.core.geometry import wrap_angle

PIECES_S = (5.0, 20.0)
"""Pieces of drives that are compared with the truth."""

EVERY_S = 1.0
TRUTH_SIGMAS = (1e-3, 1e-3, 1e-3)
"""m, m and rad: the noise of the truth at rest is a third of it; while it moves, it lags by up to 25 ms."""

HALVES = 10
PLACE, HEADING = 0.5, 0.4
"""The most that the errors may be of the nominal ones."""


def fitted(geometry: Geometry, runs: Sequence[Run]) -> WheelFit:
    """The parameters fitted to these runs; the richer model only where kinds that were left out demand it."""
    drives = [_drive(geometry, run) for run in runs]
    is_rich = needs_rich(geometry.wheel_base_m, drives)
    return fit(geometry.wheel_base_m, drives, is_rich=is_rich)


def _drive(geometry: Geometry, run: Run) -> RecordedDrive:
    left_m, right_m = _rolled(geometry, run)
    lengths = [round(piece_s / geometry.cycle_s) for piece_s in PIECES_S]
    first, last, motion, shares = in_pieces(run.poses, lengths, round(EVERY_S / geometry.cycle_s))
    return RecordedDrive(
        run.name, run.kind, left_m[1:], right_m[1:], first, last, motion, np.tile(TRUTH_SIGMAS, (len(first), 1)), shares
    )  # fmt: skip


def _rolled(geometry: Geometry, run: Run) -> tuple[Floats, Floats]:
    left_m, right_m = run.ticks.T * geometry.metres_per_tick
    return left_m, right_m


def trajectory(geometry: Geometry, model: WheelModel, run: Run) -> Floats:
    """The poses (n, 3) at the end of each cycle; headings are not wrapped."""
    return dead_reckon(model, geometry.wheel_base_m, *_rolled(geometry, run))[1:]


def halves(folder: Path, out: Path | None = None, seeds: int = HALVES) -> Outcome:
    """Fit one half of each kind's runs, and judge the other half; over so many divisions."""
    geometry, runs = read_geometry(folder), list(read_runs(folder))
    ratios: dict[str, list[tuple[float, float]]] = {}
    for seed in range(seeds):
        chosen = _half(runs, seed)
        model = fitted(geometry, chosen).model
        for kind, ratio in _ratios(geometry, model, [run for run in runs if run not in chosen]).items():
            ratios.setdefault(kind, []).append(ratio)
    if out is not None:
        chosen = _half(runs, 0)
        _write(out, geometry, fitted(geometry, chosen), chosen, runs)
    means = {
        kind: (fmean(p for p, _ in all_of), fmean(h for _, h in all_of)) for kind, all_of in ratios.items()
    }
    return Outcome(_figures(f"fitted on half, {seeds} divisions", means))


def between_folders(fit_folder: Path, score_folder: Path, out: Path | None = None) -> Outcome:
    """Fit all runs of one folder, and judge those of another."""
    geometry, runs = read_geometry(fit_folder), list(read_runs(fit_folder))
    fitted_to_all = fitted(geometry, runs)
    judged = list(read_runs(score_folder))
    score_geometry = read_geometry(score_folder) if (score_folder / "geometry.json").is_file() else geometry
    if out is not None:
        _write(out, score_geometry, fitted_to_all, runs, judged)
    figures = _figures(f"fitted on {len(runs)} runs", _ratios(score_geometry, fitted_to_all.model, judged))
    model = fitted_to_all.model
    remark = f"left {model.left:.6f}, right {model.right:.6f}, track {model.track:.6f}, spin {model.spin:.6f}"
    return Outcome(figures, remarks=(remark,))


def _half(runs: Sequence[Run], seed: int) -> list[Run]:
    """Half of the runs of each kind."""
    random, chosen = np.random.default_rng(seed), []
    for kind in sorted({run.kind for run in runs}):
        members = [run for run in runs if run.kind == kind]
        order = random.permutation(len(members))
        chosen += [members[i] for i in order[: (len(members) + 1) // 2]]
    return chosen


def _ratios(geometry: Geometry, model: WheelModel, runs: Sequence[Run]) -> dict[str, tuple[float, float]]:
    """By kind, the mean final error in place and heading as a share of the nominal one."""
    ratios = {}
    for kind in sorted({run.kind for run in runs}):
        members = [run for run in runs if run.kind == kind]
        ours, nominal = (
            np.mean([_error(geometry, one, run) for run in members], axis=0) for one in (model, NOMINAL)
        )
        ratios[kind] = (float(ours[0] / nominal[0]), float(ours[1] / nominal[1]))
    return ratios


def _error(geometry: Geometry, model: WheelModel, run: Run) -> tuple[float, float]:
    x_m, y_m, heading_rad = trajectory(geometry, model, run)[-1].tolist()
    truth = run.truth
    return math.hypot(x_m - truth.x_m, y_m - truth.y_m), abs(wrap_angle(heading_rad - truth.heading_rad))


def _figures(name: str, ratios: dict[str, tuple[float, float]]) -> tuple[Figure, ...]:
    return tuple(
        Figure(f"{name}: {kind}, {what} to nominal", value, "x", target)
        for kind, (place, heading) in ratios.items()
        for what, value, target in (("place", place, PLACE), ("heading", heading, HEADING))
    )


def _write(
    out: Path, geometry: Geometry, result: WheelFit, chosen: Sequence[Run], runs: Sequence[Run]
) -> None:
    """``parameters.json``, and for each run ``NAME.csv`` with x_m, y_m and heading_rad at the end of each cycle."""
    out.mkdir(parents=True, exist_ok=True)
    model, radius_m = result.model, geometry.wheel_diameter_m / 2
    parameters = {
        "left_radius_m": radius_m * model.left,
        "right_radius_m": radius_m * model.right,
        "track_m": geometry.wheel_base_m * model.track,
        "spin": model.spin,
        "factors": {"left": model.left, "right": model.right, "track": model.track},
        "sigmas": dict(zip(("left", "right", "track", "spin"), result.sigmas.tolist(), strict=False)),
        "fitted_to": [run.name for run in chosen],
    }
    (out / "parameters.json").write_text(json.dumps(parameters, indent=2) + "\n")
    for run in runs:
        np.savetxt(
            out / f"{run.name}.csv",
            trajectory(geometry, model, run),
            fmt="%.6f",
            delimiter=",",
            header="x_m,y_m,heading_rad",
            comments="",
        )
