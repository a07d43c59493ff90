"""The bus of the registers: what its words are, and which registers it writes."""

WORD_BITS = 32
WORD_MASK = (1 << WORD_BITS) - 1
WRITABLE = ("rw", "strobe")  # of the kinds of access
COMMIT = "commit"  # the register that lets what waits take effect
