"""Helpers for the tests of those who build on chefbotd."""
