"""The process around the daemon: its loop, its signals, its exit code, systemd."""
