"""The simulated robot: motors, world, and the LaunchPad's end of the serial protocol."""
