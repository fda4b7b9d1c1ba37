"""The way to and from files: paths, atomic writing, and reading what strangers made within limits."""
