"""The host's side of the link: the register map, and what a configuration writes into it."""
