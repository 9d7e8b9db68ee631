"""Tests of ``chefbotd.components.recording.cli``."""
