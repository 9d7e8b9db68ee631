"""What clients ask of navigation, and the feature that it is."""

from chefbotd.components.navigation.events import GoalCause, GoalList, GoalReport, GoalResult, PlanResult
from chefbotd.components.navigation.models import (
    TOPICS,
    FollowWaypointsParams,
    GetGoalParams,
    GoalParams,
    NavigateToParams,
    Waypoint,
    shown_topics,
)
from chefbotd.components.navigation.service import NavigationService
from chefbotd.features.feature import Feature, Service
from chefbotd.rpc.jobs import ProgressReporter
from chefbotd.rpc.method import Caller, method, methods_of
from chefbotd.rpc.models import DONE, Done, MotionParams, NoParams
from chefbotd.rpc.parameters import Role


class NavigationCommands:
    """What clients ask of navigation; its section names the robot's own places."""

    def __init__(self, service: NavigationService) -> None:
        self._service = service

    @method(role=Role.AGENT, moves=True)
    async def navigate_to(
        self, caller: Caller, params: NavigateToParams, progress: ProgressReporter
    ) -> GoalResult:
        """Drive to a pose in the map in use, or to a place."""
        return await self._begun([params], params, caller, progress)

    @method(role=Role.AGENT, moves=True)
    async def follow_waypoints(
        self, caller: Caller, params: FollowWaypointsParams, progress: ProgressReporter
    ) -> GoalResult:
        """Drive to several goals in order; the answer is the last goal's number, or how it ended."""
        return await self._begun(params.waypoints, params, caller, progress)

    @method(role=Role.AGENT, moves=True)
    async def go_home(self, caller: Caller, params: GoalParams, progress: ProgressReporter) -> GoalResult:
        """Drive to the place navigation.home_place (home) of the map in use."""
        home = Waypoint(place=self._service.section.home_place)
        return await self._begun([home], params, caller, progress)

    @method(role=Role.AGENT, moves=True)
    async def dock(self, caller: Caller, params: GoalParams, progress: ProgressReporter) -> GoalResult:
        """Drive to the place navigation.dock_place (dock) of the map in use."""
        dock = Waypoint(place=self._service.section.dock_place)
        return await self._begun([dock], params, caller, progress)

    async def _begun(
        self, waypoints: list[Waypoint], params: GoalParams, caller: Caller, progress: ProgressReporter
    ) -> GoalResult:
        goals = await self._service.navigate_to(waypoints, params, caller.session)
        if params.wait:
            return await self._service.waits.wait(goals, progress, caller.session.number)
        return self._service.result(goals)

    @method(role=Role.OBSERVE)
    def get_goal(self, caller: Caller, params: GetGoalParams) -> GoalReport:
        """What became of a goal; the ends of the last 400 are remembered until the daemon ends."""
        return self._service.report(params.goal, params.goal_id)

    @method(role=Role.OBSERVE)
    def list_goals(self, caller: Caller, params: NoParams) -> GoalList:
        """The goals that have not ended, in the order in which they are driven to."""
        return self._service.active_goals()

    @method(role=Role.OBSERVE)
    async def plan_to(self, caller: Caller, params: Waypoint, progress: ProgressReporter) -> PlanResult:
        """Plan a path without driving: whether there is one, its length, and the time it takes."""
        return await self._service.plan_to(params)

    @method(role=Role.OBSERVE, for_guests=True)
    def cancel_navigation(self, caller: Caller, params: NoParams) -> Done:
        """End all goals; the robot comes to rest."""
        self._service.cancel(f"by {caller.session}", GoalCause.ASKED, str(caller.session))
        return DONE

    @method(role=Role.OBSERVE, for_guests=True)
    def pause_navigation(self, caller: Caller, params: NoParams) -> Done:
        """Stop the robot, and keep its goals."""
        self._service.pause(str(caller.session))
        return DONE

    @method(role=Role.AGENT, moves=True)
    def resume_navigation(self, caller: Caller, params: MotionParams) -> Done:
        """Continue with the goals from the robot's present pose."""
        self._service.resume()
        return DONE


def navigation(service: NavigationService) -> Feature:
    """Navigation in the worker, over the service that puts its wishes through the gate."""
    return Feature(
        "navigation",
        services=(Service("navigation", service.run, in_steps=True),),
        methods=methods_of(NavigationCommands(service)),
        topics=(*TOPICS, *shown_topics(service.shown.show_costmap, service.shown.show_obstacles)),
        parts={"navigation": service},
        waiting=service.waits.waiting,
    )
