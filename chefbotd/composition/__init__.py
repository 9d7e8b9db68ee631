"""Builds the daemon's parts from the configuration. Optional parts are loaded only if they are configured."""
