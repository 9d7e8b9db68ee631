"""Sensors: ranges, IMU and battery in SI units."""
