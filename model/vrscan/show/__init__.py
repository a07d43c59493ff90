"""How tables and pictures look, of every command and page; it uses ``data`` alone."""
