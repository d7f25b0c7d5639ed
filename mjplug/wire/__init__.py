"""The server's topics and services on Zenoh. Zenoh's threads only decode, validate and enqueue messages here."""
