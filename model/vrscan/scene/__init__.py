"""What the sensor sees: targets, beam, light, optics and noise, from a scene's TOML file to lines.

This package uses the configuration and the float equations, but neither twins nor registers. Tests,
the engines of the virtual board and the studies use it.
"""
