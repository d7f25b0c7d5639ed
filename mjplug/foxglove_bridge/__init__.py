"""Serves the topics, services and parameters of a network to Foxglove and Lichtblick, over their WebSocket protocol."""
