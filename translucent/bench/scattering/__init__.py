"""Scenes whose media scatter light many times, their stored truth, and what engines show of them."""
