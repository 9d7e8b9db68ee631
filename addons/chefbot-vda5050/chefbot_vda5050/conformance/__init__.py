"""Whether a robot keeps to VDA 5050: cases from the standard's text, for any robot on a broker."""
