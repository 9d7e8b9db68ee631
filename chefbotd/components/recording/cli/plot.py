"""Plots a recording: wheel speeds and targets, the path, the battery, and the faults."""

import json
from pathlib import Path
from typing import Any

from msgspec import Struct, field

from chefbotd.cli.common.exits import Exit, ProgramError, extra
from chefbotd.components.maps.cli.asking import write_file
from chefbotd.components.recording.cli.info import open_recording

WANTED = {"WheelsDriven", "OdometryUpdated", "BatteryMeasured", "SafetyChanged"}
WIDTH_INCHES, PANEL_INCHES, PATH_INCHES, DOTS_PER_INCH = 11.0, 2.6, 5.0, 110


class Curves(Struct):
    """What is drawn, over seconds from the first event on."""

    wheels_s: list[float] = field(default_factory=list)
    speeds: list[tuple[float, ...]] = field(default_factory=list)
    targets: list[tuple[float, ...]] = field(default_factory=list)
    x_m: list[float] = field(default_factory=list)
    y_m: list[float] = field(default_factory=list)
    battery_s: list[float] = field(default_factory=list)
    battery_v: list[float] = field(default_factory=list)
    faults: list[tuple[float, str]] = field(default_factory=list)
    names: tuple[str, ...] = ()
    problem: str | None = None


def read_curves(path: Path) -> Curves:
    """What a recording has of it.

    Raises:
        ProgramError: the file is no recording, or nothing in it can be drawn.
    """
    curves, began_s, fault = Curves(), None, None
    with open_recording(path) as reader:
        for event in reader.events():
            name = type(event).__name__
            if name not in WANTED:
                continue
            began_s = event.stamp_s if began_s is None else began_s
            at_s = event.stamp_s - began_s
            if name == "WheelsDriven":
                curves.wheels_s.append(at_s)
                curves.speeds.append(event.velocity_rad_s)
                curves.targets.append(event.target_rad_s)
            elif name == "OdometryUpdated":
                curves.x_m.append(event.odom_from_base.x_m)
                curves.y_m.append(event.odom_from_base.y_m)
            elif name == "BatteryMeasured":
                curves.battery_s.append(at_s)
                curves.battery_v.append(event.voltage_v)
            else:
                if event.fault not in (None, fault):
                    curves.faults.append((at_s, event.fault))
                fault = event.fault
        curves.problem = reader.problem
        curves.names = _wheel_names(reader.metadata.get("configuration", {}).get("json", ""))
    if began_s is None:
        names = ", ".join(sorted(WANTED))
        raise ProgramError(Exit.FAILED, f"{path} has nothing that can be drawn: none of {names}")
    return curves


def _wheel_names(configuration: str) -> tuple[str, ...]:
    """What the wheels are called in the configuration that was recorded; none where there is none."""
    try:
        return tuple(str(wheel["name"]) for wheel in json.loads(configuration)["chassis"]["wheels"])
    except (ValueError, KeyError, TypeError):
        return ()


def plot_png(path: Path, out: Path, *, force: bool) -> None:
    """Draw it into a PNG.

    Raises:
        ProgramError: the file is no recording, or the picture cannot be written.
    """
    if out.suffix.lower() != ".png":
        raise ProgramError(Exit.USAGE, f"--out {out}: expected a name that ends in .png")
    curves = read_curves(path)
    with extra("plot", "matplotlib"):
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    wheels = len(curves.speeds[0]) if curves.speeds else 0
    panels = wheels + bool(curves.battery_s)
    path_inches = PATH_INCHES if curves.x_m else 0.0
    heights = [*[PANEL_INCHES] * panels, *([path_inches] if path_inches else [])] or [PANEL_INCHES]
    figure = Figure(figsize=(WIDTH_INCHES, sum(heights) + 0.8), dpi=DOTS_PER_INCH, layout="constrained")
    FigureCanvasAgg(figure)
    axes = list(figure.subplots(len(heights), 1, squeeze=False, height_ratios=heights)[:, 0])
    note = f" ({curves.problem})" if curves.problem else ""
    figure.suptitle(f"{path.name}{note}", fontsize=11)
    for wheel in range(wheels):
        _draw_wheel(axes[wheel], curves, wheel)
    if curves.battery_s:
        axes[wheels].plot(curves.battery_s, curves.battery_v, color="tab:green", linewidth=1.0)
        axes[wheels].set_title("battery", loc="left", fontsize=9)
        axes[wheels].set_ylabel("voltage, V")
    for axis in axes[:panels]:
        _mark_faults(axis, curves)
        axis.set_xlabel("time, s")
        axis.grid(alpha=0.3)
    if curves.x_m:
        _draw_path(axes[-1], curves)
    _save(figure, out, force=force)


def _draw_wheel(axis: Any, curves: Curves, wheel: int) -> None:
    targets = [row[wheel] for row in curves.targets]
    axis.plot(curves.wheels_s, targets, color="0.5", linewidth=1.2, label="asked for")
    axis.plot(
        curves.wheels_s,
        [row[wheel] for row in curves.speeds],
        color="tab:blue",
        linewidth=0.9,
        label="measured",
    )
    name = curves.names[wheel] if wheel < len(curves.names) else f"wheel {wheel + 1}"
    axis.set_title(name.replace("_", " "), loc="left", fontsize=9)
    axis.set_ylabel("speed, rad/s")
    axis.legend(loc="upper right", fontsize=8)


def _mark_faults(axis: Any, curves: Curves) -> None:
    for at_s, fault in curves.faults:
        axis.axvline(at_s, color="tab:red", linewidth=1.0)
        axis.annotate(
            fault,
            (at_s, 1.0),
            xycoords=("data", "axes fraction"),
            color="tab:red",
            fontsize=8,
            va="top",
            ha="right",
        )


def _draw_path(axis: Any, curves: Curves) -> None:
    axis.plot(curves.x_m, curves.y_m, color="tab:purple", linewidth=1.0)
    axis.plot(curves.x_m[0], curves.y_m[0], "o", color="tab:green", label="start")
    axis.plot(curves.x_m[-1], curves.y_m[-1], "s", color="tab:red", label="end")
    axis.set_aspect("equal", adjustable="datalim")
    axis.set_xlabel("x in odom, m")
    axis.set_ylabel("y in odom, m")
    axis.grid(alpha=0.3)
    axis.legend(fontsize=8)


def _save(figure: Any, out: Path, *, force: bool) -> None:
    import io

    data = io.BytesIO()
    figure.savefig(data, format="png")
    write_file(out, data.getvalue(), force=force)
