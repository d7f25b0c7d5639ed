"""The server's own topics and services. Their host resolves `~/x` to `/<namespace>/<node_name>/x`."""
