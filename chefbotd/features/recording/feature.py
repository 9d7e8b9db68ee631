"""The feature: recording."""

from chefbotd.features.feature import Feature, Service
from chefbotd.features.recording.methods import TOPICS, RecordingMethods
from chefbotd.features.recording.service import RecordingService
from chefbotd.metrics import Metrics
from chefbotd.rpc.method import methods_of


def recording(service: RecordingService) -> Feature:
    """Files and the ring, over the service that keeps them."""
    return Feature(
        "recording",
        services=(Service("recording", service.run),),
        methods=methods_of(RecordingMethods(service)),
        topics=TOPICS,
        add_metrics=lambda metrics: _add_metrics(metrics, service),
    )


def _add_metrics(metrics: Metrics, service: RecordingService) -> None:
    metrics.gauge(
        "recording_bytes",
        "Of the current or the last recording.",
        lambda: service.thread.status.bytes_written,
    )
    metrics.counter(
        "recording_dropped",
        "Events that were dropped on their way to the disk.",
        lambda: service.thread.dropped,
    )
    metrics.gauge("recording_waiting", "Events on their way to the disk.", lambda: service.waiting)
    metrics.gauge(
        "recording_ring_bytes", "The last minutes in memory.", lambda: service.thread.status.ring_bytes
    )
    metrics.optional_gauge(
        "recording_free_bytes",
        "Free space of the disk at the last check.",
        lambda: service.thread.status.free_bytes,
    )
    metrics.counter(
        "recording_faults_saved", "Faults whose recording was saved.", lambda: service.faults_saved
    )
