"""The server's topics and services on Zenoh. Zenoh's threads decode, check and enqueue here, never more."""
