"""What the sensor sees: targets, beam, light, optics and noise, from a scene's TOML file to lines.

It knows the configuration and the float equations, but neither twins nor registers. Tests, engines
of the virtual board, and studies use it.
"""
