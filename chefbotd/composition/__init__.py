"""The daemon's parts, built from the configuration. Optional ones are loaded only where they are configured."""
