"""Plays bags: publishes their messages as a server does, in the pace in which they were recorded."""
