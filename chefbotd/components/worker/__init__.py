"""The worker: one child process for work that takes longer than a control step (SLAM, localization, navigation)."""
