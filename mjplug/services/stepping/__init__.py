"""`~/step`: inputs, steps and results in one request; and which client may step the server."""
