"""Tuning: gains that change while the robot drives."""
