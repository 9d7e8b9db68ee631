"""The methods, the topic and the figures of the camera, and how many may look at a time."""

from typing import Final

from chefbotd.clock import Clock
from chefbotd.components.camera.camera import Camera
from chefbotd.components.camera.events import CameraChanged, CameraData
from chefbotd.components.camera.link.source import CameraLost
from chefbotd.components.camera.models import CameraFigures, CameraFrame, GetCameraFrameParams
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.record import replace
from chefbotd.core.sentence import Sentence
from chefbotd.features.feature import Feature, Service
from chefbotd.metrics import Metrics
from chefbotd.rpc.jobs import ProgressReporter
from chefbotd.rpc.method import Caller, method, methods_of
from chefbotd.rpc.models import NoParams
from chefbotd.rpc.parameters import Role
from chefbotd.rpc.topics import Topic, same_names

GONE_S: Final = 6.0
"""Who has not asked again for so long looks no more; one that reads nothing is disconnected before (``[api]``)."""


class CameraService:
    """Hands out pictures: one at a time to each client, so that one that reads slowly, or not at all, holds one."""

    def __init__(self, camera: Camera, clock: Clock) -> None:
        self._camera, self._clock = camera, clock
        self._waiting: set[int] = set()
        self._seen_s: dict[int, float] = {}

    @property
    def viewers(self) -> int:
        """How many clients look."""
        self._forget_gone()
        return len(self._seen_s.keys() | self._waiting)

    @method(role=Role.DRIVE, moves=False)
    async def get_camera_frame(
        self, caller: Caller, params: GetCameraFrameParams, progress: ProgressReporter
    ) -> CameraFrame:
        """Wait for the next picture of the camera, which runs while somebody asks."""
        number = caller.session.number
        self._require_place(number)
        self._waiting.add(number)
        try:
            frame = await self._camera.next_picture(params.after, params.wait_s)
            self._seen_s[number] = self._clock.now_s()
        except CameraLost as lost:
            raise Refused(
                RefusalKind.NO_PICTURE, Sentence("camera.no_picture", "no picture: {why}", why=lost)
            ) from lost
        finally:
            self._waiting.discard(number)
        return frame

    @method(role=Role.OBSERVE)
    def get_camera_status(self, caller: Caller, params: NoParams) -> CameraFigures:
        """How the camera is, and what it did since the daemon's start."""
        camera, data = self._camera, self._camera.data
        age_s = None if camera.newest is None else max(self._clock.now_s() - camera.newest.taken_s, 0.0)
        return CameraFigures(
            data.state,
            data.reason,
            camera.parameters.source_name,
            data.width_px,
            data.height_px,
            age_s,
            camera.pictures,
            camera.dropped,
            camera.starts,
            self.viewers,
        )

    def _require_place(self, number: int) -> None:
        if number in self._waiting:
            raise Refused(
                RefusalKind.TOO_MANY_VIEWERS,
                Sentence(
                    "camera.waiting", "this client is waiting for a picture already: ask for one at a time"
                ),
            )
        most = self._camera.parameters.max_viewers
        self._forget_gone()
        if number not in self._seen_s and self.viewers >= most:
            raise Refused(
                RefusalKind.TOO_MANY_VIEWERS,
                Sentence(
                    "camera.full", "{most} clients look at the camera, which is the most at a time", most=most
                ),
            )

    def _forget_gone(self) -> None:
        now_s = self._clock.now_s()
        for number in [number for number, seen_s in self._seen_s.items() if now_s - seen_s > GONE_S]:
            del self._seen_s[number]


def camera_feature(camera: Camera, clock: Clock) -> Feature:
    """The feature of the camera."""
    service = CameraService(camera, clock)

    def add_metrics(metrics: Metrics) -> None:
        metrics.counter("camera_pictures", "Pictures that the camera has sent.", lambda: camera.pictures)
        metrics.counter(
            "camera_dropped", "What was cut, damaged or too long to be a picture.", lambda: camera.dropped
        )
        metrics.counter("camera_starts", "How often the camera was started.", lambda: camera.starts)

    rows = [
        replace(row, role=camera.parameters.role) if row.name == "get_camera_frame" else row
        for row in methods_of(service)
    ]
    return Feature(
        "camera",
        services=(Service("camera", camera.run),),
        methods=tuple(rows),
        topics=(Topic("camera", (CameraChanged,), CameraData, same_names(CameraData)),),
        add_metrics=add_metrics,
        not_replayed=tuple(row.name for row in rows),
    )
