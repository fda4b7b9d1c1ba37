"""Speed against error, measured in one run."""
