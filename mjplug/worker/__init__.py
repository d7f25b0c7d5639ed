"""Processes that do the works of plugins: the server's side, and what runs in them (`python -m mjplug.worker`)."""
