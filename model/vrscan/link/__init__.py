"""The host's side of the serial link: protocol, device, streams of points, self-test.

It uses the twins to know the answers that a board has to give; ``docs/link.md`` has the protocol.
"""
