"""A package, so that the servers that its tests share end with the last of them (pytest's scope `package`)."""
