"""The serial protocol of the LaunchPad, both ends: standard library only, no clock, no I/O."""
