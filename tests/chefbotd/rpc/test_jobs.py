"""Requests that take their time: answered when they end, with progress on the way, and cancelled in three ways."""

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

import pytest
from structlog.testing import capture_logs

from chefbotd.client import CallError, CallTimeout, Client
from chefbotd.clock import run_virtual
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.record import Record
from chefbotd.rpc.dispatch import Dispatcher
from chefbotd.rpc.jobs import MAX_JOBS, ProgressReporter
from chefbotd.rpc.method import Caller, Method, method, methods_of
from chefbotd.rpc.models import DONE, Done, NoParams, Params
from chefbotd.rpc.parameters import Role
from tests.fakes.api import LineClient, Served, line_client, serving


class SurveyParams(Params):
    """How many rooms to look at, and the one in which it goes wrong."""

    rooms: int
    broken: int = 0
    locked: int = 0


class Surveyed(Record, frozen=True):
    """How many were looked at."""

    rooms: int


class Survey:
    """A feature with a method that takes 2 s for each room; ``cancelled`` counts surveys that were cut short."""

    def __init__(self) -> None:
        self.cancelled = 0

    @method(role=Role.OBSERVE)
    async def survey(self, caller: Caller, params: SurveyParams, progress: ProgressReporter) -> Surveyed:
        """Look at each room."""
        try:
            for room in range(1, params.rooms + 1):
                await asyncio.sleep(2.0)
                if room == params.broken:
                    raise BufferError("the map is full")
                if room == params.locked:
                    raise Refused(RefusalKind.OUT_OF_RANGE, f"room {room} is locked")
                progress.report(room, params.rooms, f"room {room}")
        except asyncio.CancelledError:
            self.cancelled += 1
            raise
        return Surveyed(rooms=params.rooms)


Scenario = Callable[[Served, Survey], Awaitable[None]]


def with_survey(scenario: Scenario, **limits: Any) -> None:
    """Run a scenario on a server with the method ``survey``, beside its own."""

    async def main() -> None:
        async with serving(**limits) as served:
            survey, known = Survey(), served.server.connections.dispatcher
            (row,) = methods_of(survey)
            served.server.connections.dispatcher = Dispatcher(
                {**known._methods, "survey": row}, known._clock, known._arrivals, 0.5, known.jobs
            )
            await scenario(served, survey)

    run_virtual(main())


async def now(client: LineClient, *, count: int) -> list[dict[str, Any]]:
    """The next messages."""
    return [await client.read() for _ in range(count)]


def test_a_job_reports_progress_and_is_answered_when_it_ends() -> None:
    """Three rooms: three reports with the request's id, then the result; a ping in between is answered at once."""

    async def scenario(served: Served, survey: Survey) -> None:
        async with line_client(served) as client:
            client.request("survey", 7, rooms=3)
            client.request("ping", 8)
            ping, *reports, answer = await now(client, count=5)
            assert ping["id"] == 8
            assert [report["params"] for report in reports] == [
                {"id": 7, "done": room, "total": 3.0, "text": f"room {room}"} for room in (1, 2, 3)
            ]
            assert {report["method"] for report in reports} == {"progress"}
            assert answer == {"jsonrpc": "2.0", "id": 7, "result": {"rooms": 3}}

    with_survey(scenario)


def test_a_cancelled_job_ends_and_is_answered_so() -> None:
    """``cancel`` is answered first, then the request itself; a second cancel finds nothing."""

    async def scenario(served: Served, survey: Survey) -> None:
        async with line_client(served) as client:
            client.request("survey", 7, rooms=3)
            client.request("cancel", 8, id=7)
            done, answer = await now(client, count=2)
            assert (done["id"], done["result"]) == (8, {"ok": True})
            assert (answer["id"], answer["error"]["data"]["kind"]) == (7, "cancelled")
            client.request("cancel", 9, id=7)
            (nothing,) = await now(client, count=1)
            assert nothing["error"]["data"]["kind"] == "no_such_job"

    with_survey(scenario)


def test_nobody_cancels_the_job_of_another_client() -> None:
    """The same id is another request there."""

    async def scenario(served: Served, survey: Survey) -> None:
        async with line_client(served) as ann, line_client(served) as bob:
            ann.request("survey", 7, rooms=1)
            await asyncio.sleep(0.5)
            bob.request("cancel", 8, id=7)
            assert (await bob.read())["error"]["data"]["kind"] == "no_such_job"
            assert [message.get("id") for message in await now(ann, count=2)] == [None, 7]

    with_survey(scenario)


def test_a_job_ends_with_its_client() -> None:
    """The client disconnects after 1 s of 6; the handler is cancelled."""

    async def scenario(served: Served, survey: Survey) -> None:
        async with line_client(served) as client:
            client.request("survey", 7, rooms=3)
            await asyncio.sleep(1.0)
        await asyncio.sleep(0.5)
        assert (survey.cancelled, len(served.server.connections)) == (1, 0)

    with_survey(scenario)


def test_a_job_ends_when_its_client_closes_its_sending_side() -> None:
    """Nobody can cancel it any more, so it does not outlive its connection, which the daemon closes."""

    async def scenario(served: Served, survey: Survey) -> None:
        async with line_client(served) as client:
            client.request("survey", 7, rooms=3)
            client.half_close()
            with pytest.raises(EOFError):
                await client.read(1.5)
            await asyncio.sleep(0.1)
            assert (survey.cancelled, len(served.server.connections)) == (1, 0)

    with_survey(scenario)


def test_a_client_has_so_many_jobs_at_a_time() -> None:
    """The ninth, and one with the id of another, are refused; when the eight have ended there is room again."""

    async def scenario(served: Served, survey: Survey) -> None:
        async with line_client(served) as client:
            for number in range(MAX_JOBS - 1):
                client.request("survey", number, rooms=1)
            client.request("survey", 0, rooms=1)
            client.request("survey", 100, rooms=1)
            client.request("survey", 101, rooms=1)
            kinds = [message["error"]["data"]["kind"] for message in await now(client, count=2)]
            assert kinds == ["invalid_request", "too_many_jobs"]
            answers = [m["id"] for m in await now(client, count=2 * MAX_JOBS) if "id" in m]
            assert sorted(answers) == [*range(MAX_JOBS - 1), 100]
            client.request("survey", 102, rooms=1)
            assert [message.get("id") for message in await now(client, count=2)] == [None, 102]

    with_survey(scenario)


def test_a_job_fails_as_any_request_does() -> None:
    """A refusal says what the robot does not do; a fault is counted, logged and told apart."""

    async def scenario(served: Served, survey: Survey) -> None:
        async with line_client(served) as client:
            client.request("survey", 1, rooms=2, locked=1)
            client.request("survey", 2, rooms="two")
            invalid, refused = await now(client, count=2)
            assert (invalid["id"], invalid["error"]["data"]["kind"]) == (2, "invalid_params")
            assert (refused["id"], refused["error"]["message"]) == (1, "room 1 is locked")
            with capture_logs() as logs:
                client.request("survey", 3, rooms=1, broken=1)
                (fault,) = await now(client, count=1)
            assert (fault["id"], fault["error"]["data"]["kind"]) == (3, "internal")
            assert served.server.connections.dispatcher.faults == {"survey": 1}
            assert [log["event"] for log in logs] == ["handler_fault"]
            assert isinstance(logs[0]["exc_info"], BufferError)

    with_survey(scenario)


def test_a_stop_does_not_wait_for_a_job() -> None:
    """It is carried out while the client's own job runs, and the job goes on."""

    async def scenario(served: Served, survey: Survey) -> None:
        async with line_client(served) as client:
            client.request("survey", 1, rooms=1)
            client.request("stop", 2)
            assert (await client.read())["id"] == 2
            assert served.robot.calls == [("stop",)]
            assert [message.get("id") for message in await now(client, count=2)] == [None, 1]

    with_survey(scenario)


def test_a_method_that_stops_cannot_be_a_job() -> None:
    """A stop goes from the socket to the wire in one call stack; an async handler would break that."""

    async def late_stop(caller: Caller, params: Params, progress: ProgressReporter) -> Record:
        raise NotImplementedError

    row = Method(Role.OBSERVE, Params, Record, late_stop, urgent=True)
    with pytest.raises(ValueError, match=r"stop is urgent, so its handler must not be async"):
        Dispatcher({"stop": row}, None, None, 0.5)  # type: ignore[arg-type]


def test_the_client_library_hears_of_progress_and_may_take_longer_than_its_timeout() -> None:
    """Each report allows another second of 3: four rooms take 8 s; without reports 3 s are the end."""

    async def scenario(served: Served, survey: Survey) -> None:
        reports: list[tuple[float, float, str]] = []
        async with Client.connect(served.host, served.port, timeout_s=3.0) as robot:
            answer = await robot.call("survey", on_progress=lambda *report: reports.append(report), rooms=4)
            assert (answer, reports[1], len(reports)) == ({"rooms": 4}, (2.0, 4.0, "room 2"), 4)
            with pytest.raises(CallTimeout):
                await robot.call("survey", rooms=4)
            await robot.call("ping")
            await asyncio.sleep(0.1)
            assert survey.cancelled == 1

    with_survey(scenario)


def test_cancelling_the_task_that_waits_cancels_the_request() -> None:
    """After 1 s; the connection serves on."""

    async def scenario(served: Served, survey: Survey) -> None:
        async with Client.connect(served.host, served.port) as robot:
            with pytest.raises(TimeoutError):
                async with asyncio.timeout(1.0):
                    await robot.call("survey", rooms=4)
            await robot.call("ping")
            await asyncio.sleep(0.1)
            assert survey.cancelled == 1
            with pytest.raises(CallError, match="room 1 is locked"):
                await robot.call("survey", rooms=1, locked=1)

    with_survey(scenario)


def test_a_fault_of_the_progress_listener_is_raised_where_the_answer_is_awaited() -> None:
    """It ends neither the connection nor the job of anybody else; the request is cancelled."""

    async def scenario(served: Served, survey: Survey) -> None:
        def broken(done: float, total: float, text: str) -> None:
            raise LookupError(text)

        async with Client.connect(served.host, served.port) as robot:
            with pytest.raises(LookupError, match="room 1"):
                await robot.call("survey", on_progress=broken, rooms=4)
            await robot.call("ping")
            await asyncio.sleep(0.1)
            assert survey.cancelled == 1

    with_survey(scenario)


class Go:
    """A feature whose job moves the robot; ``begun`` counts how often it did."""

    def __init__(self) -> None:
        self.begun = 0

    @method(role=Role.DRIVE, moves=True)
    async def go(self, caller: Caller, params: NoParams, progress: ProgressReporter) -> Done:
        """Move, sooner or later."""
        self.begun += 1
        await asyncio.sleep(1.0)
        return DONE


@pytest.mark.parametrize("stop", ["stop", "estop"])
def test_a_stop_voids_a_job_that_moves_and_whose_task_has_not_begun(stop: str) -> None:
    """One read brings a job and another client's stop behind it: the job never begins, and its client hears why."""

    async def main() -> None:
        async with serving() as served:
            go, known = Go(), served.server.connections.dispatcher
            (row,) = methods_of(go)
            dispatcher = served.server.connections.dispatcher = Dispatcher(
                {**known._methods, "go": row}, known._clock, known._arrivals, 0.5, known.jobs
            )
            async with line_client(served) as goes, line_client(served) as stops:
                goes.request("go", 1)
                stops.request(stop, 2)
                answer = await goes.read()
                assert answer["error"]["data"]["kind"] == "overtaken"
                assert go.begun == 0
                assert dispatcher.void == {"overtaken": 1}
                assert "result" in await stops.read()
                goes.request("go", 3)
                assert (await goes.read())["id"] == 3
                assert go.begun == 1

    run_virtual(main())


def test_a_handler_that_a_request_could_not_call_is_refused_when_it_is_declared() -> None:
    """A coroutine function takes a progress too, any other does not: said at the start, not at the first call."""

    async def tidy(self: object, caller: Caller, params: NoParams) -> Done:
        raise NotImplementedError

    def look(self: object, caller: Caller, params: NoParams, progress: ProgressReporter) -> Done:
        raise NotImplementedError

    declare = method(role=Role.OBSERVE)
    with pytest.raises(
        TypeError, match=r"tidy: expected async def tidy\(self, caller, params, progress\), got async"
    ):
        declare(tidy)
    with pytest.raises(
        TypeError, match=r"look: expected def look\(self, caller, params\), got def look\(self"
    ):
        declare(look)
