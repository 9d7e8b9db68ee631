"""Services that fail."""

import asyncio
from collections.abc import Awaitable, Callable

import pytest

from chefbotd.clock import LoopClock, run_virtual
from chefbotd.process.build import MOST_FAILURES, ServiceLost, Supervisor
from chefbotd.safety.faults import Fault, FaultKind


def supervised(scenario: Callable[[Supervisor, list[Fault]], Awaitable[None]]) -> None:
    """Run a scenario with a supervisor and the faults that it has reported."""

    async def run() -> None:
        faults: list[Fault] = []
        await scenario(Supervisor(LoopClock()), faults)

    run_virtual(run())


def failing(times: int, every_s: float) -> tuple[Callable[[], Awaitable[None]], list[float]]:
    """A service that fails so many times and then lives; the list is when it was started."""
    started_s: list[float] = []

    async def loop() -> None:
        started_s.append(asyncio.get_running_loop().time())
        await asyncio.sleep(every_s if len(started_s) <= times else 3600.0)
        raise RuntimeError("broken")

    return loop, started_s


async def ended(task: "asyncio.Task[None]") -> None:
    """Cancel and wait."""
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)


def test_a_service_that_fails_is_reported_and_started_again():
    """Each failure is a fault that names service and error; then the service runs on."""

    async def scenario(supervisor: Supervisor, faults: list[Fault]) -> None:
        loop, started_s = failing(2, every_s=1.0)
        task = asyncio.create_task(supervisor.run_restarting("odometry", loop, faults.append))
        await asyncio.sleep(10.0)
        assert len(started_s) == 3
        reason = "the service 'odometry' failed: RuntimeError('broken')"
        assert faults == [Fault(FaultKind.SERVICE_FAILED, reason)] * 2
        assert supervisor.failures == {"odometry": 2}
        await ended(task)

    supervised(scenario)


def test_a_service_that_somebody_cancels_is_started_again():
    """A cancelled task is a failure like any other."""

    async def scenario(supervisor: Supervisor, faults: list[Fault]) -> None:
        loop, started_s = failing(0, every_s=0.0)
        task = asyncio.create_task(supervisor.run_restarting("sensors", loop, faults.append))
        await asyncio.sleep(1.0)
        next(t for t in asyncio.all_tasks() if t.get_name() == "sensors").cancel()
        await asyncio.sleep(1.0)
        assert len(started_s) == 2
        assert faults == [Fault(FaultKind.SERVICE_FAILED, "the service 'sensors' failed: was cancelled")]
        await ended(task)

    supervised(scenario)


def test_too_many_failures_within_a_minute_are_passed_on():
    """Five are survived, the sixth is not."""

    async def scenario(supervisor: Supervisor, faults: list[Fault]) -> None:
        loop, _ = failing(1000, every_s=1.0)
        with pytest.raises(ServiceLost, match="6 failures within 60 s") as lost:
            await supervisor.run_restarting("stats", loop, faults.append)
        assert isinstance(lost.value.__cause__, RuntimeError)
        assert len(faults) == MOST_FAILURES + 1

    supervised(scenario)


def test_a_failure_now_and_then_is_survived_for_ever():
    """One every 13 s are five in any minute."""

    async def scenario(supervisor: Supervisor, faults: list[Fault]) -> None:
        loop, _ = failing(1000, every_s=13.0)
        task = asyncio.create_task(supervisor.run_restarting("stats", loop, faults.append))
        await asyncio.sleep(1310.5)
        assert len(faults) == 100
        assert not task.done()
        await ended(task)

    supervised(scenario)


def test_cancelling_the_supervisor_ends_the_service_and_is_no_fault():
    """The service is given time to clean up."""

    async def scenario(supervisor: Supervisor, faults: list[Fault]) -> None:
        tidied = []

        async def loop() -> None:
            try:
                await asyncio.sleep(3600.0)
            finally:
                await asyncio.sleep(0.5)
                tidied.append(True)

        task = asyncio.create_task(supervisor.run_restarting("odometry", loop, faults.append))
        await asyncio.sleep(1.0)
        await ended(task)
        assert tidied
        assert not faults

    supervised(scenario)


@pytest.mark.parametrize("error", [OSError("in use"), KeyboardInterrupt()])
def test_the_error_of_a_service_that_cannot_be_missed_is_passed_on(error: BaseException):
    """As it is, so that the one who started it can tell."""

    async def loop() -> None:
        await asyncio.sleep(0)
        raise error

    async def scenario(supervisor: Supervisor, faults: list[Fault]) -> None:
        await supervisor.run_critical("server", loop)

    with pytest.raises(type(error)):
        supervised(scenario)


def test_a_service_that_cannot_be_missed_must_not_end():
    """Whoever returns, or is cancelled by somebody, is lost."""

    async def scenario(supervisor: Supervisor, faults: list[Fault]) -> None:
        async def returns() -> None:
            await asyncio.sleep(0)

        with pytest.raises(ServiceLost, match="link has ended"):
            await supervisor.run_critical("link", returns)

    supervised(scenario)
