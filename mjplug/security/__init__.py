"""Certificates, the folder that holds them, and the roles of those who have one."""
