"""Installs chefbotd as a systemd service, and removes it, in steps that are reported."""
