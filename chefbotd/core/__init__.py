"""The robot's vocabulary: values that every other package speaks in."""
