"""Records the topics of a network into a bag. It is a client like any other: servers only provide their topics."""
