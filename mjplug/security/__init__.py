"""Certificates, the folder that contains them, and the roles of their owners."""
