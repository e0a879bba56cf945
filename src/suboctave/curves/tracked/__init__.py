"""Curves of bifurcations in two parameters, and of their extrema in three: starts, events, corners, ends."""
