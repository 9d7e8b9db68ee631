"""Demonstrations on a simulated robot, built on the client: ``chefbotctl serve`` and ``chefbotctl map demo``.

The sources have them, an installed package has not.
"""
