"""The style of the tables and pictures of every command and page; it uses ``data`` only."""
