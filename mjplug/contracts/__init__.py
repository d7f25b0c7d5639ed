"""What the parts of the server agree on: endpoints, works, diagnostics, prepared messages."""
