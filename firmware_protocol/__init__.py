"""The LaunchPad's serial wire, both ends of it: standard library only, no clock, no I/O."""
