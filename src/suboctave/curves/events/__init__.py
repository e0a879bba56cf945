"""Events along curves: how bifurcations and grazings are noticed between neighbours, and located."""
