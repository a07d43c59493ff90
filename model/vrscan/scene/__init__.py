"""Light to sensor lines. For now: Gaussian spots on simple surfaces at known scan angles."""
