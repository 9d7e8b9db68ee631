"""Tests of ``chefbotd.cli.record``."""
