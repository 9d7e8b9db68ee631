"""Tests of the buildings that come with the simulator."""
