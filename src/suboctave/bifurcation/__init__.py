"""Where a response changes: limit points, branch points, period doublings, Neimark-Sacker points."""
