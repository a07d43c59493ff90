"""The host's side of the serial link: protocol, device, streams of points, self-test.

It uses the twins to know what a board has to answer; ``docs/link.md`` has the protocol.
"""
