"""Model files: where they are, how they are read, and what mjplug adds to them."""
