"""Worker processes for plugins: the server's side, and the code that runs in them (`python -m mjplug.worker`)."""
