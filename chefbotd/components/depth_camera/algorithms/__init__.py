"""From a depth image to a scan: pure."""
