"""Where pictures come from: a device of Video4Linux, or the output of a program."""
