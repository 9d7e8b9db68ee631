"""Compiles, or loads from the cache, all code of navigation before the first goal."""

import math

import numpy as np

from chefbotd.components.navigation.algorithms.beside_people import slowed_beside_people
from chefbotd.components.navigation.algorithms.brake_for_people import brake_for_people
from chefbotd.components.navigation.algorithms.evade import evading_twist
from chefbotd.components.navigation.algorithms.interface import NavigationParameters, Seen
from chefbotd.components.navigation.algorithms.navigator import Navigator
from chefbotd.components.navigation.algorithms.path import Goal
from chefbotd.components.navigation.algorithms.world_model import WorldModel
from chefbotd.components.worker.compiled import release_libraries
from chefbotd.components.zones.zone_file import NO_ZONES
from chefbotd.core.geometry import ORIGIN, STANDING, Pose2D, Twist2D
from chefbotd.core.occupancy_grid import FREE, OCCUPIED, OccupancyGrid

CELLS, CELL_M, STEPS, WALKED = 80, 0.05, 60, 20
BOX = slice(60, 64)


def warm(params: NavigationParameters) -> None:
    """Begin to drive through a small room with a box and a post in it, and give back the memory of libraries."""
    percent = np.full((CELLS, CELLS), FREE, np.int8)
    percent[0], percent[-1], percent[:, 0], percent[:, -1] = OCCUPIED, OCCUPIED, OCCUPIED, OCCUPIED
    percent[BOX, BOX] = OCCUPIED
    middle_m = CELLS * CELL_M / 2
    navigator, pose = Navigator(params), Pose2D(middle_m / 2, middle_m, math.pi / 2)
    navigator.use_map(OccupancyGrid(CELL_M, ORIGIN, percent))
    post = np.array([[0.3, -middle_m / 2], [0.35, -middle_m / 2]])
    navigator.take_scan(Seen(0.0, pose, np.zeros(2), post))
    wall = np.array([[0.0, middle_m / 2], [0.05, middle_m / 2], [0.1, middle_m / 2]])  # it is on the map
    navigator.take_scan(Seen(0.0, pose, np.zeros(2), wall))
    navigator.take_range(0.0, pose, Pose2D(), 0.7, 0.26)
    _meet_somebody(params)
    navigator.navigate_to((Goal(1.5 * middle_m, middle_m, 0.0),))
    for k in range(STEPS):
        navigator.take_scan(Seen(0.05 * k, pose, np.zeros(2), post))
        step = navigator.step(0.05 * k, pose)
        if step.twist is not None:
            turned = pose.heading_rad + step.twist.angular_rad_s * 0.05
            pose = Pose2D(pose.x_m, pose.y_m, turned)
    release_libraries()


def _meet_somebody(params: NavigationParameters) -> None:
    """Plan about, and make way for, somebody who walks towards the robot."""
    world = WorldModel(params, OccupancyGrid(CELL_M, ORIGIN, np.zeros((CELLS, CELLS), np.int8)), NO_ZONES)
    pose, person = Pose2D(1.0, 2.0, 0.0), np.array([[0.0, -0.2], [-0.2, 0.0], [0.0, 0.2]])
    for k in range(WALKED):
        points = person + np.array([2.5 - 0.05 * k, 0.0])
        world.add_scan(Seen(0.1 * k, pose, np.zeros(2), points))
    world.costs(0.1 * WALKED, pose)
    surroundings = world.surroundings(pose, 0.1 * WALKED)
    world.beside(surroundings)
    evading_twist(params.outline, surroundings, STANDING, 0.0, is_stuck=True)
    slowed_beside_people(params.outline, surroundings, Twist2D(0.2, 0.0))
    brake_for_people(params.outline, surroundings, STANDING, Twist2D(0.2, 0.0), None, params.agility)
