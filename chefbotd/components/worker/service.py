"""Sends the worker every scan, range and odometry, the last in a frame that never jumps; the topic ``worker``."""

from collections.abc import Mapping

from msgspec.structs import asdict

from chefbotd.bus import Bus
from chefbotd.clock import Clock
from chefbotd.components.worker.parameters import WorkerParameters
from chefbotd.components.worker.process import Worker, WorkerMemory, WorkerStatus
from chefbotd.components.worker.spawn import Spawn, spawn
from chefbotd.core.events import OdometryReset, OdometryUpdated, RangeMeasured, RangeStatus
from chefbotd.core.events.lidars import ScanMeasured
from chefbotd.core.events.robot import MapPoseUpdated, WorkerData, WorkerReported
from chefbotd.core.geometry import ORIGIN, Pose2D
from chefbotd.core.record import MutableState, StatefulPart, replace
from chefbotd.features.feature import Feature, ReplayedInputs, Service
from chefbotd.inputs import inputs_of
from chefbotd.metrics import Metrics
from chefbotd.rpc.topics import Topic, same_names

TOPICS = (Topic("worker", (WorkerReported,), WorkerData, same_names(WorkerData), always_known=True),)


class WorkerServiceState(MutableState):
    """The worker, and the pose of ``odom`` in the frame of its skills."""

    worker: WorkerMemory
    steady_from_odom: Pose2D = ORIGIN


class WorkerService(StatefulPart[WorkerServiceState]):
    """Owns the worker. Its skills get odometry in the frame ``steady``, in which a reset is no motion."""

    def __init__(
        self,
        bus: Bus,
        clock: Clock,
        parameters: WorkerParameters,
        skills: Mapping[str, bytes],
        start: Spawn | None = None,
    ) -> None:
        self._bus, self._entries = bus, inputs_of(clock)
        self.worker = Worker(parameters, clock, skills, self._report_status, start or spawn)
        self.memory, self.parts = WorkerServiceState(self.worker.memory), {"worker": self.worker}
        bus.add_handler(self._send_odometry, OdometryUpdated)
        bus.add_handler(self._take_reset, OdometryReset)
        bus.add_handler(self.worker.send, ScanMeasured)
        bus.add_handler(self._send_range, RangeMeasured)

    def in_odom(self, event: MapPoseUpdated) -> MapPoseUpdated:
        """A pose from the worker, relative to the present ``odom``."""
        return replace(event, map_from_odom=event.map_from_odom.compose(self.memory.steady_from_odom))

    async def run(self) -> None:
        """Keep the worker alive."""
        await self.worker.run()

    def _report_status(self, status: WorkerStatus) -> None:
        self._entries.observe(
            self._bus,
            WorkerReported(stamp_s=self._entries.now_s(), **{**asdict(status), "state": str(status.state)}),
        )

    def _take_reset(self, event: OdometryReset) -> None:
        """Note that the pose ``before`` in ``odom`` is now ``after``, without motion."""
        self.memory.steady_from_odom = self.memory.steady_from_odom.compose(event.before).compose(
            event.after.inverse()
        )

    def _send_odometry(self, event: OdometryUpdated) -> None:
        steady_from_base = self.memory.steady_from_odom.compose(event.odom_from_base)
        turned_rad = self.memory.steady_from_odom.heading_rad
        covariance = event.covariance.turned(turned_rad) if turned_rad else event.covariance
        self.worker.send(replace(event, odom_from_base=steady_from_base, covariance=covariance))

    def _send_range(self, event: RangeMeasured) -> None:
        """Send only echoes: other readings do not say where something is."""
        if event.status is RangeStatus.OK:
            self.worker.send(event)


def worker(service: WorkerService) -> Feature:
    """The feature for the worker's process, its input and the topic ``worker``."""
    process = service.worker

    def add_metrics(metrics: Metrics) -> None:
        metrics.counter("worker_restarts", "Restarts of the worker.", lambda: process.memory.status.restarts)
        metrics.counter(
            "worker_dropped",
            "Scans and odometry that were dropped, because the worker did not read in time.",
            lambda: process.dropped_measurements,
        )
        metrics.optional_gauge(
            "worker_rss_mb", "Resident memory of the worker.", lambda: process.memory.status.rss_mb
        )
        metrics.optional_gauge(
            "worker_cpu", "The worker's share of one core.", lambda: process.memory.status.cpu
        )

    def inputs() -> ReplayedInputs:
        from chefbotd.components.worker.replayed import replayed_inputs  # only a replay needs it

        return replayed_inputs(process)

    return Feature(
        "worker",
        services=(Service("worker", service.run),),
        topics=TOPICS,
        add_metrics=add_metrics,
        parts={"worker": service},
        inputs=inputs,
        offers=service,
        skill_host=process,
    )
