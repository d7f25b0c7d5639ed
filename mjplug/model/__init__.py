"""Model files: their location, loading, and mjplug's extensions."""
