"""The ``vrscan`` command: its options and its output. Only ``__main__`` uses this package."""
