"""The server's own services, each offered through a host that resolves `~/x` to `/<namespace>/<node_name>/x`."""
