"""The worker: the one child process, for what takes longer than a control step (SLAM, localization, navigation)."""
