"""Checks of the computer, the port and the service."""

from collections.abc import Mapping, Sequence

from chefbotd.components.doctor.algorithms.finding import Finding, ok, problem, skip_check, warning
from chefbotd.core.record import Record
from chefbotd.rpc.models import PluginDescription, PluginState

SERVICE_PROGRAM = "chefbotd"


class PortFound(Record, frozen=True):
    """The state of a device file before it is opened.

    ``held_by`` names the program that has it open (empty: none is visible), ``others`` lists the other ports, and
    ``permission`` says what to do if we may not open it (empty: we may).
    """

    device: str
    exists: bool
    permission: str = ""
    held_by: str = ""
    others: str = ""
    is_socket: bool = False


def check_device(port: PortFound) -> Finding:
    """Whether the device is there."""
    if port.is_socket:
        return ok("device", f"the board is behind {port.device}, not on a port of this computer")
    if port.exists:
        return ok("device", f"{port.device} is there")
    return problem(
        "device",
        f"the device {port.device} does not exist; {port.others}",
        "plug the board in (a charging cable has no data lines), then set [link] device to its /dev/serial/by-id name",
    )


def check_permission(port: PortFound) -> Finding:
    """Whether this user may open it."""
    if not port.exists:
        return skip_check("permission", "there is no device")
    if port.permission:
        return problem("permission", f"you may not open {port.device}", port.permission)
    return ok("permission", f"you may read and write {port.device}")


def check_holder(port: PortFound, *, daemon_answers: bool) -> Finding:
    """Whether another program has it open; a daemon that answers may."""
    if not port.exists:
        return skip_check("holder", "there is no device")
    if not port.held_by:
        return ok("holder", f"nobody has {port.device} open")
    if daemon_answers and SERVICE_PROGRAM in port.held_by:
        return ok("holder", f"{port.device} is held by the daemon: {port.held_by}")
    if SERVICE_PROGRAM in port.held_by:
        return problem(
            "holder",
            f"{port.device} is held by {port.held_by}, which does not answer at the address that was asked",
            "say where it listens with --connect, or stop it: 'sudo systemctl stop chefbotd'",
        )
    return problem(
        "holder",
        f"{port.device} is held by {port.held_by}",
        "end that program (a serial monitor, ModemManager, another driver): two readers each get half of the bytes",
    )


def check_baud(configured: int, heard: int | None, *, heard_anything: bool) -> Finding:
    """Whether the board talks at the configured rate; ``heard`` is the one at which it does, where any is."""
    if heard == configured:
        return ok("baud", f"the board sends valid lines at {configured} baud")
    if heard is not None:
        return problem(
            "baud",
            f"at {configured} baud there is only garbage, but at {heard} the board sends valid lines",
            f"set [link] baud = {heard}",
        )
    if heard_anything:
        return problem(
            "baud",
            f"no valid line was received at {configured} baud or at the other usual rates",
            "is this the right port? Which rate does the sketch pass to Serial.begin?",
        )
    return skip_check("baud", "nothing was received at any baud rate")


def check_governor(governors: Sequence[str]) -> Finding:
    """Whether the processor is slowed down to save power."""
    if not governors:
        return skip_check(
            "cpu_governor", "this computer reports none (a virtual machine, or its firmware decides)"
        )
    kinds = ", ".join(sorted(set(governors)))
    if "powersave" not in governors:
        return ok("cpu_governor", f"the CPU governor is {kinds}")
    return warning(
        "cpu_governor",
        f"the CPU governor is {kinds}",
        "it may wake up late: 'sudo cpupower frequency-set -g performance' where latency is found bad",
    )


def check_priority(realtime: int | None, nice: int, locked_kb: int, *, daemon_answers: bool) -> Finding:
    """The priority and memory that the computer gives the control loop; ``realtime`` None: its process is not known."""
    if realtime is None and daemon_answers:
        return skip_check("priority", "a daemon answers, but its process cannot be told from the others here")
    if realtime is None:
        return skip_check("priority", "no daemon answers on this computer")
    memory = "its memory is locked" if locked_kb else "its memory may be swapped out"
    if realtime:
        return ok("priority", f"the control loop has real-time priority {realtime}, and {memory}")
    return warning(
        "priority",
        f"the control loop has no real-time priority (nice {nice}), and {memory}: a busy computer may hold it up",
        "run it as the service, whose unit allows it ('sudo chefbotd install-service'), or allow it with LimitRTPRIO=20 "
        "and LimitMEMLOCK=infinity (docs/service.md)",
    )


def check_time_sync(synchronized: bool | None) -> Finding:
    """Whether the wall clock is right; only log files and recordings need it."""
    if synchronized is None:
        return skip_check("time_sync", "this computer does not report whether its clock is synchronized")
    if synchronized:
        return ok("time_sync", "the computer's clock is synchronized")
    return warning(
        "time_sync",
        "the computer's clock is not synchronized",
        "'sudo timedatectl set-ntp true'; the robot runs on its own clock, only dates in logs are wrong",
    )


def check_service(unit: Mapping[str, str] | None) -> Finding:
    """The systemd unit, by the properties of ``systemctl show``; None without systemd."""
    if unit is None:
        return skip_check("service", "systemd does not run here")
    if unit.get("LoadState") != "loaded":
        return skip_check(
            "service", "no unit chefbotd.service is installed", "'sudo chefbotd install-service' does so"
        )
    active, enabled = unit.get("ActiveState", ""), unit.get("UnitFileState", "")
    result, code = unit.get("Result", ""), unit.get("ExecMainStatus", "")
    text = f"chefbotd.service is {active} and {enabled}, started again {unit.get('NRestarts', '0')} times"
    ended = "" if result in ("", "success") else f"; its last end was {result} with exit code {code}"
    if active == "failed" or (ended and active != "active"):
        return problem("service", text + ended, "'journalctl -u chefbotd -n 50' says why")
    if enabled not in ("enabled", "enabled-runtime", "static", "linked"):
        return warning("service", text + ended, "'sudo systemctl enable chefbotd' starts it at boot")
    if active != "active":
        return warning("service", text + ended, "'sudo systemctl start chefbotd'")
    return ok("service", text + ended)


def check_socket(where: str, answer: str, refusal: str) -> Finding:
    """Whether a daemon answers at an address; ``answer`` describes it, ``refusal`` says why none answers."""
    if answer:
        return ok("socket", f"a daemon answers at {where}: {answer}")
    return skip_check("socket", f"no daemon answers at {where}{refusal}: the doctor opens the port itself")


def check_plugins(plugins: Sequence[PluginDescription]) -> list[Finding]:
    """What became of each plug-in that the configuration allows."""
    return [_check_plugin(plugin) for plugin in plugins]


def _check_plugin(plugin: PluginDescription) -> Finding:
    name = f"plugin {plugin.name}"
    if plugin.state is PluginState.RUNNING:
        return ok(name, f"{plugin.package} {plugin.version} runs")
    advice = {
        PluginState.NOT_FOUND: "install its package in the daemon's environment, or take it out of [plugins] allow",
        PluginState.INCOMPATIBLE: "install a version of it that fits this chefbotd",
        PluginState.FAILED: "mend it, or take it out of [plugins] allow; the daemon's log has the same error",
    }
    return problem(name, f"it is left out: {plugin.reason}", advice[plugin.state])


def check_configuration(origin: str, *, wanted_robot: str, robot: str) -> Finding:
    """Which configuration is used; ``robot`` is the running daemon's name (empty: no daemon runs)."""
    if robot and robot != wanted_robot:
        return problem(
            "configuration",
            f"the daemon drives {robot!r}, and {origin} describes {wanted_robot!r}",
            "give the daemon's own with --config: the findings below compare with the wrong configuration",
        )
    return ok("configuration", f"the robot is compared with {origin} ({wanted_robot})")
