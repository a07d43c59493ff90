"""The ``vrscan`` command: its options, and what it prints. Nothing but ``__main__`` uses it."""
