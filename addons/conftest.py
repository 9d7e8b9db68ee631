"""What the tests of all add-ons have in common."""

import signal

# A shell starts a job in the background with SIGINT ignored, and the programs that are tested would inherit that.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
