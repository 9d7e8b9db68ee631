"""The feature: the worker process."""

from chefbotd.features.feature import Feature, Service
from chefbotd.features.worker.methods import TOPICS
from chefbotd.features.worker.service import WorkerService
from chefbotd.metrics import Metrics


def worker(service: WorkerService) -> Feature:
    """The process, what it is fed with, and the topic that says how it stands."""
    process = service.worker

    def add_metrics(metrics: Metrics) -> None:
        metrics.counter("worker_restarts", "Restarts of the worker.", lambda: process.status.restarts)
        metrics.counter(
            "worker_dropped",
            "Scans and odometry that were dropped, because the worker did not read in time.",
            lambda: process.dropped,
        )
        metrics.optional_gauge(
            "worker_rss_mb", "Resident memory of the worker.", lambda: process.status.rss_mb
        )
        metrics.optional_gauge("worker_cpu", "The worker's share of one core.", lambda: process.status.cpu)

    return Feature(
        "worker",
        services=(Service("worker", service.run),),
        topics=TOPICS,
        add_metrics=add_metrics,
        parts=(service,),
    )
