"""The feature: the sensors that the robot has."""

from chefbotd.features.feature import Feature, Service
from chefbotd.features.sensors.methods import TOPICS
from chefbotd.features.sensors.service import SensorService
from chefbotd.metrics import Metrics


def sensors(service: SensorService) -> Feature:
    """Their readings in SI units, over the service that interprets them."""

    def add_metrics(metrics: Metrics) -> None:
        metrics.optional_gauge(
            "battery_v",
            "The battery's voltage.",
            lambda: None if service.battery is None else service.battery.voltage_v,
        )
        metrics.optional_gauge(
            "battery_percentage",
            "The remaining charge of the battery.",
            lambda: None if service.battery is None else service.battery.percentage,
        )

    return Feature(
        "sensors",
        services=(Service("sensors", service.run),),
        topics=TOPICS,
        add_metrics=add_metrics,
        parts=(service,),
    )
