"""The server's part of the simulation view: the scene, its frames, and bodies that viewers drag."""
