"""What holds for every test."""

import signal

# A shell's background jobs ignore an interrupt, and so would what the tests start to interrupt it.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
