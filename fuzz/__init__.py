"""Coverage-guided fuzzing of what strangers can send: the serial line and the command socket. Run ``make fuzz``."""
