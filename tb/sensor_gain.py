"""The gain of the sensor in the tests of the peak."""

KAPPA = 0.2  # counts of 12 bits an electron


def kappa_register(pixel_width: int) -> int:
    """Return KAPPA as its register has it."""
    return round(KAPPA * 2 ** (28 - pixel_width))
