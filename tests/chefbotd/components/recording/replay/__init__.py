"""Tests of ``chefbotd.components.recording.replay``."""
