"""Decides who may move the robot, and whether it may move at all: pure functions."""
