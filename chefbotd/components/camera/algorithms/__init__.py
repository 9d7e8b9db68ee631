"""From bytes to whole JPEG pictures: pure."""
