"""The composition root: from a configuration to a server on the network."""
