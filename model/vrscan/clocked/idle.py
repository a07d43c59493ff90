"""How long a twin may stand still."""

MOST_IDLE = 1 << 40  # clocks that a twin says it can skip, where nothing but an input ends that
