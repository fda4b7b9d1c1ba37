"""The panels of the previewer's window."""
