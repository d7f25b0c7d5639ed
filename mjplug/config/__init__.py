"""Configuration files: reading, validation, and error messages with the place of each error."""
