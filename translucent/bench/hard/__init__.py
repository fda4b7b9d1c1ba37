"""The hard cases: inputs that break renderers, each measured against what is promised for it."""
