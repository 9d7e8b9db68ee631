"""Recordings: made, looked at, replayed."""
