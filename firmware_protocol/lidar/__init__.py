"""The protocols of lidars, both ends of each: standard library only, no clock, no I/O."""
