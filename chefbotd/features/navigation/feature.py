"""The feature: navigation."""

from chefbotd.features.feature import Feature, Service
from chefbotd.features.navigation.methods import TOPICS, NavigationMethods, shown_topics
from chefbotd.features.navigation.service import NavigationService
from chefbotd.rpc.method import methods_of


def navigation(service: NavigationService) -> Feature:
    """Navigation in the worker, over the service that puts its wishes through the gate."""
    return Feature(
        "navigation",
        services=(Service("navigation", service.run, in_steps=True),),
        methods=methods_of(NavigationMethods(service, service.section)),
        topics=(*TOPICS, *shown_topics(service.shown.show_costmap, service.shown.show_obstacles)),
        parts=(service,),
        waiting=service.waiting,
    )
