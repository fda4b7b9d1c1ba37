"""Benchmark of translucency that anybody can run against a renderer of theirs."""
