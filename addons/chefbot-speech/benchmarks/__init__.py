"""Measurements of chefbot-speech."""
