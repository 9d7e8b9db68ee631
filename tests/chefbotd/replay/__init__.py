"""Tests of ``chefbotd.replay``."""
