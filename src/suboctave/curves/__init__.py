"""What is continued: response curves, curves of bifurcations and of extrema, their first points and their events."""
