"""The simulated robot: motors, world and the LaunchPad's side of the wire."""
