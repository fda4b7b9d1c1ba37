"""Files: paths, atomic writing, and reading of untrusted files within limits."""
